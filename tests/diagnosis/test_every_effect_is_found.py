"""The contract of every effect on the side of the diagnosis: planted, simulated with noise, it is found again."""

from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.catalogue import EFFECTS
from delaytools.design.design import Design, parse_design
from delaytools.design.edit import with_effect
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.effects.formula import FormulaEffect
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Multisine, Stimulus
from delaytools.simulation.simulate import simulate

SECONDS = 5.0
SERVO = """
frame = "1 ms"
[signals]
demand = "deg"
command = "deg"
x = "deg"
gust = "deg"
[blocks.controller]
type = "sample_hold"
input = "demand"
output = "command"
period = "5 ms"
[blocks.actuator]
type = "second_order"
input = "command"
output = "x"
natural_frequency = "60 rad/s"
damping = 0.6
"""
MOVES = Multisine(amplitude=3.0, from_frequency=0.25, to_frequency=6.0, lines=24)
GUST: Stimulus = Multisine(amplitude=1.0, from_frequency=0.4, to_frequency=5.1, lines=11)


@final
@dataclass(frozen=True)
class Planted:
    """An effect as a design file writes it, the names that also count as found, and the exit's noise."""

    at: str
    values: dict[str, Any]
    also: tuple[str, ...] = ()
    noise: float = 0.01
    signal: str = "x"
    reads: dict[str, Any] = field(default_factory=dict)


PLANTED = {
    "backlash": Planted("actuator.input", {"half_width": 0.3}),
    "bias": Planted("actuator.output", {"level": 0.3}),
    "constant_disturbance": Planted("actuator.rate'", {"level": 1000.0}, also=("bias",)),
    "coulomb_friction": Planted("actuator.rate'", {"level": 800.0, "smoothing": 2.0}),
    "cross_coupling": Planted("actuator.output", {"gain": 0.2, "source": "gust"}),
    "cubic_damping": Planted("actuator.rate'", {"coefficient": -0.001}),
    "cubic_stiffness": Planted("actuator.rate'", {"coefficient": -10.0}),
    "dead_band": Planted("actuator.input", {"half_width": 0.3}),
    "delay": Planted("actuator.input", {"delay": "9 ms"}),
    "dropped_frames": Planted("controller.output", {"probability": 0.2}, noise=0.0, signal="command"),
    "flexible_mode": Planted(
        "actuator.output", {"gain": 0.05, "frequency": 14.0, "damping": 0.05, "source": "command"}
    ),
    "gain_drift": Planted("actuator.output", {"rate": 0.05}),
    "lag": Planted("actuator.input", {"time_constant": "15 ms"}),
    "load_dependent_friction": Planted("actuator.rate'", {"coefficient": 0.3, "smoothing": 2.0}),
    "periodic_interference": Planted("actuator.output", {"amplitude": 0.3, "frequency": 11.0, "phase": 0.4}),
    "quadratic_drag": Planted("actuator.rate'", {"coefficient": -0.1}),
    "quantization": Planted("actuator.output", {"step": 0.2}, noise=0.0),
    "rate_limit": Planted("actuator.rate", {"limit": 40.0}),
    "sample_hold": Planted("actuator.input", {"period": "20 ms"}, noise=0.003),
    "saturation": Planted("actuator.input", {"limit": 4.0}),
    "scale_factor": Planted("actuator.output", {"factor": 1.15}),
    "stribeck_friction": Planted(
        "actuator.rate'", {"level": 500.0, "stiction": 1500.0, "speed": 20.0, "smoothing": 3.0}
    ),
    "transient_gain": Planted("actuator.output", {"factor": 0.7, "start": 2.0, "end": 3.5}),
    "variable_delay": Planted(
        "actuator.input", {"mean": 0.012, "amplitude": 0.006, "frequency": 0.7, "phase": 0.5}
    ),
    "parameter_change:natural_frequency": Planted("actuator", {"natural_frequency": 45.0}),
}


def log_of(design: Design, planted: Planted) -> Record:
    """A run of the bench with noise on what is measured of the actuator."""
    run = simulate(build(design), {"demand": MOVES, "gust": GUST}, duration=SECONDS, seed=4).record
    generator = np.random.default_rng(11)
    columns = {name: run[name] for name in ("demand", "command", "x")}
    columns["x"] = columns["x"] + planted.noise * generator.standard_normal(len(run))
    columns["gust"] = GUST.value(run.time)
    return Record(run.time, columns, {"demand": "deg", "command": "deg", "x": "deg", "gust": "deg"})


@pytest.mark.parametrize("kind", PLANTED)
def test_it_is_found(kind: str) -> None:
    planted = PLANTED[kind]
    design = parse_design(SERVO)
    table = {"type": kind, "at": planted.at, **planted.values}
    answer = diagnose(design, [log_of(with_effect(design, table), planted)], effort=Effort(processes=1))
    found = [(one.effect, one.signal) for one in answer.missing]
    allowed = [(name, planted.signal) for name in (kind, *planted.also)]
    assert len(found) == 1 and found[0] in allowed, f"{answer.verdict}: {answer.missing} {answer.confusable}"


# draws, own ticks, odd rows, forces, joints at an output, changed numbers: each is another way through a replay
DESIGNED = ("dropped_frames", "sample_hold", "quantization", "load_dependent_friction", "bias", "variable_delay",
            "parameter_change:natural_frequency")  # fmt: skip


@pytest.mark.parametrize("kind", DESIGNED)
def test_with_it_in_the_design_nothing_is_missing(kind: str) -> None:
    planted = PLANTED[kind]
    design = with_effect(parse_design(SERVO), {"type": kind, "at": planted.at, **planted.values})
    answer = diagnose(design, [log_of(design, planted)], effort=Effort(processes=1))
    assert answer.verdict == "adequate" and not answer.missing, f"{answer.missing} {answer.unexplained}"


def test_nothing_is_found_where_nothing_is_missing() -> None:
    design = parse_design(SERVO)
    answer = diagnose(design, [log_of(design, Planted("", {}))], effort=Effort(processes=1))
    assert answer.verdict == "adequate" and not answer.missing


def test_every_kind_of_the_catalogue_is_planted() -> None:
    """All but a formula, which is the user's own: the diagnosis cannot know it."""
    assert {kind.partition(":")[0] for kind in PLANTED} == {*EFFECTS, "parameter_change"} - {
        FormulaEffect.kind
    }
