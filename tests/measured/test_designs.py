"""Textbook designs for measured logs: they read, build and are sensible; with the logs at hand, they meet them."""

import gzip
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from delaytools.design.build import build, check_paths, warnings
from delaytools.design.design import Design
from delaytools.design.edit import with_effect, with_value
from delaytools.design.file import read_design
from delaytools.loop.loop import Loop
from delaytools.loop.network import network
from delaytools.loop.segments import segments
from delaytools.loop.values import resolve
from delaytools.measurement.log_file import Columns, read_log
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column
from delaytools.simulation.simulate import simulate

ROOT = Path(__file__).parents[2]
LOGS = ROOT.parent / "shared" / "measured"
_Array = NDArray[np.float64]
measured = [
    pytest.mark.measured,
    pytest.mark.skipif(not LOGS.is_dir(), reason="the measured logs are not part of the project"),
]

# design -> signals that its logs hold
MEASURED = {
    "emps": ["ref_position", "motor_voltage", "motor_force", "position"],
    "silverbox": ["input_voltage", "output_voltage"],
    "daisy_dryer": ["heater_voltage", "outlet_temperature"],
    "bam_xl330": ["goal_position", "torque_enable", "input_voltage", "position"],
    "dart_car": ["steering_cmd", "speed", "yaw_rate"],
    "qube_pendulum": [
        *("target_theta", "target_alpha", "theta", "alpha"),
        *("control_output", "feedforward", "plant_input"),
    ],
}
# design -> where the effect that it lacks acts, and the first measured signal behind
MISSING = {
    "emps": ({"type": "coulomb_friction", "at": "drive.v'", "level": 0.2, "smoothing": 1e-3}, "position"),
    "silverbox": (
        {"type": "cubic_stiffness", "at": "resonator.rate'", "coefficient": -7e5},
        "output_voltage",
    ),
    "daisy_dryer": ({"type": "delay", "at": "heater.input", "delay": 0.16}, "outlet_temperature"),
    "bam_xl330": (
        {"type": "load_dependent_friction", "at": "servo.w'", "coefficient": 0.2, "smoothing": 0.02},
        "position",
    ),
    "dart_car": ({"type": "lag", "at": "steering.command", "time_constant": 0.13}, "yaw_rate"),
    "qube_pendulum": ({"type": "quantization", "at": "arm.theta", "step": 0.00306796}, "theta"),
}


def _design(name: str) -> Design:
    return read_design(ROOT / "designs" / "measured" / f"{name}.toml")


def test_every_design_is_listed() -> None:
    files = {path.stem for path in (ROOT / "designs" / "measured").glob("*.toml")}
    assert files == set(MEASURED) == set(MISSING)


@pytest.mark.parametrize("name", MEASURED)
def test_reads_and_builds_in_every_configuration(name: str) -> None:
    design = _design(name)
    for configuration in (None, *design.configurations):
        loop = build(design, configuration)
        check_paths(design, loop)
        assert not loop.elements[0].modifiers and not design.tables.effects
    assert warnings(design, build(design)) == ()
    assert design.tables.tolerance


@pytest.mark.parametrize("name", MEASURED)
def test_runs_and_stays_finite_as_its_inputs_drive_it(name: str) -> None:
    loop = build(_design(name))
    driven = {signal: _constant(0.1) for signal in loop.externals}
    run = simulate(loop, driven, duration=max(0.5, 20 * loop.frame))
    assert run.diverged is None
    assert all(np.abs(run.record[signal]).max() < 1000 for signal in MEASURED[name])


@pytest.mark.parametrize("name", MEASURED)
def test_the_missing_effect_acts_in_the_segment_that_ends_at_its_signal(name: str) -> None:
    design, (effect, signal) = _design(name), MISSING[name]
    port = str(effect["at"])
    loop = build(design)
    found = [part for part in segments(loop, MEASURED[name]) if port.partition(".")[0] in part.blocks]
    assert [part.name for part in found] == [signal]
    build(with_effect(design, effect))


def test_balanced_pendulum_stands() -> None:
    loop = build(_design("qube_pendulum"))
    run = simulate(loop, {"target_theta": _constant(0.1)}, duration=6.0)
    assert run.record["theta"][-1] == pytest.approx(0.1, abs=0.01)
    assert run.record["alpha"][-1] == pytest.approx(0.0, abs=0.01)


def _constant(level: float) -> Column:
    return Column(time=np.array([0.0, 1.0]), values=np.array([level, level]))


# --- against the logs -------------------------------------------------------------------------------------------------
def _log(loop: Loop, path: Path) -> Record:
    held = network(resolve(loop)).held_signals
    return read_log(path, Columns("time", {}, dict(loop.units), held))


def _changed(design: Design, values: Mapping[str, Any], effects: Iterable[Mapping[str, Any]] = ()) -> Design:
    for path, value in values.items():
        design = with_value(design, path, value)
    for table in effects:
        design = with_effect(design, table)
    return design


def _errors(loop: Loop, log: Record, signal: str, *, seconds: float, substeps: int | None = None) -> _Array:
    """Simulated - measured at the frames, the loop driven by the log's columns at its external inputs."""
    clock = log.time - log.time[0]
    names = [name for name in loop.externals if name in log]
    driven = {name: Column(time=clock, values=log[name], held=name in log.held) for name in names}
    run = simulate(loop, driven, duration=seconds, substeps=substeps).record
    return run[signal] - np.interp(run.time, clock, log[signal])


def _rms(errors: _Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def _mark(function: Any) -> Any:
    for mark in measured:
        function = mark(function)
    return function


@_mark
def test_qube_controller_is_known_to_the_last_digit() -> None:
    loop = build(_design("qube_pendulum"))
    for path in sorted((LOGS / "qube_pendulum").glob("*.csv")):
        log = _log(loop, path)
        parts = {part.name: part.loop for part in segments(loop, log.names)}
        assert _segment_error(parts["control_output"], log, "control_output") < 1e-5
        assert _segment_error(parts["plant_input"], log, "plant_input") < 1e-5


@_mark
def test_emps_controller_and_amplifier_hold() -> None:
    loop = build(_design("emps"))
    log = _log(loop, LOGS / "emps" / "emps_estimation.csv")
    parts = {part.name: part.loop for part in segments(loop, log.names)}
    assert _segment_error(parts["motor_force"], log, "motor_force") < 1e-4
    assert _segment_error(parts["motor_voltage"], log, "motor_voltage") < 0.03 * np.std(log["motor_voltage"])


def _segment_error(loop: Loop, log: Record, signal: str) -> float:
    driven = {
        name: Column(time=log.time, values=log[name.partition("@")[0]], held=name in log.held)
        for name in loop.externals
    }
    run = simulate(loop, driven, duration=float(log.time[-1])).record
    return _rms(run[signal] - np.interp(run.time, log.time, log[signal]))


@_mark
def test_dryer_needs_its_delay() -> None:
    """Best fits of two lags: 73 % without, 88.7 % with the delay; published for 3 samples: 88.8 %."""
    before = {
        "heater.gain": 1.02,
        "heater.time_constant": 0.284,
        "thermocouple.time_constant": 0.284,
        "parameters.ambient": -0.194,
    }
    after = {
        "heater.gain": 0.935,
        "heater.time_constant": 0.253,
        "thermocouple.time_constant": 0.135,
        "parameters.ambient": 0.218,
    }
    delay = {"type": "delay", "at": "heater.input", "delay": "156 ms"}
    errors = [
        _dryer(_changed(_design("daisy_dryer"), before)),
        _dryer(_changed(_design("daisy_dryer"), after, [delay])),
    ]
    assert errors[0] > 0.2
    assert errors[1] < 0.1


def _dryer(design: Design) -> float:
    loop = build(design)
    log = _log(loop, LOGS / "daisy_dryer" / "dryer.csv")
    settled = round(3.0 / loop.frame)  # the unknown start has died out
    return _rms(_errors(loop, log, "outlet_temperature", seconds=79.0)[settled:])


@_mark
def test_silverbox_needs_its_cubic_spring(tmp_path: Path) -> None:
    before = {
        "resonator.natural_frequency": 444.94,
        "resonator.damping": 0.0552,
        "resonator.gain": 0.9694,
        "parameters.voltmeter_offset": -0.0052,
    }
    after = {
        "resonator.natural_frequency": 429.31,
        "resonator.damping": 0.04882,
        "resonator.gain": 1.0516,
        "parameters.voltmeter_offset": -0.00546,
    }
    spring = {"type": "cubic_stiffness", "at": "resonator.rate'", "coefficient": -7.2817e5}
    log = tmp_path / "silverbox.csv"
    with gzip.open(LOGS / "silverbox" / "silverbox_schroeder.csv.gz") as packed, log.open("wb") as plain:
        shutil.copyfileobj(packed, plain)
    assert _silverbox(_changed(_design("silverbox"), before), log) > 15e-3
    assert _silverbox(_changed(_design("silverbox"), after, [spring]), log) < 1.5e-3


def _silverbox(design: Design, path: Path) -> float:
    loop = build(design)
    return _rms(_errors(loop, _log(loop, path), "output_voltage", seconds=40.0, substeps=4)[600:])


@_mark
def test_dart_lag_and_delay_are_as_good() -> None:
    static = _curves(left=(1.451, 0.3481), right=(1.534, 0.3944), trim=0.0454)
    moving = _curves(left=(1.48, 0.3482), right=(1.46, 0.4086), trim=0.0443)
    lag = {"type": "lag", "at": "steering.command", "time_constant": "176 ms"}
    delay = {"type": "delay", "at": "steering.command", "delay": "169 ms"}
    without = _dart(_changed(_design("dart_car"), static))
    either = [_dart(_changed(_design("dart_car"), moving, [effect])) for effect in (lag, delay)]
    assert max(either) < 0.75 * without
    assert max(either) < 1.06 * min(either)


def _curves(*, left: tuple[float, float], right: tuple[float, float], trim: float) -> dict[str, float]:
    """Values of both steering curves, each (slope, largest angle in rad)."""
    names = ("left_slope", "left", "right_slope", "right", "trim")
    return {f"steering.{name}": value for name, value in zip(names, (*left, *right, trim), strict=True)}


def _dart(design: Design) -> float:
    """Root mean square of the yaw rate's error over the sine runs, where the car drives (above 0.8 m/s)."""
    loop, found = build(design), []
    for path in sorted((LOGS / "dart_car").glob("sine_*.csv")):
        log = _log(loop, path)
        errors = _errors(loop, log, "yaw_rate", seconds=float(log.time[-1]) - 0.2)
        frames = loop.frame * np.arange(len(errors))
        found.append(errors[np.interp(frames, log.time, log["speed"]) > 0.8])
    return _rms(np.concatenate(found))


@_mark
def test_bam_published_friction_halves_the_error() -> None:
    """Published: position error 0.138 rad without friction, 0.069 with Coulomb and viscous friction."""
    inertia = 0.49 * 0.10**2 + 0.0018
    coulomb = {"type": "coulomb_friction", "at": "servo.w'", "level": 0.01283 / inertia, "smoothing": 0.02}
    without = _bam(_changed(_design("bam_xl330"), {"servo.viscous": 0.0}))
    with_it = _bam(_changed(_design("bam_xl330"), {"servo.viscous": 0.00366}, [coulomb]))
    assert without == pytest.approx(0.13, abs=0.015)
    assert with_it == pytest.approx(0.067, abs=0.005)


def _bam(design: Design) -> float:
    """Mean over the runs of the mean absolute position error, the position loop closed in the model."""
    found = []
    for path in sorted((LOGS / "bam_xl330").glob("*.csv")):
        loop = build(design, "gain_" + path.stem.partition("_kp")[2][:3])
        found.append(float(np.mean(np.abs(_errors(loop, _log(loop, path), "position", seconds=5.9)))))
    return float(np.mean(found))
