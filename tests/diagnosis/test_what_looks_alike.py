"""What looks like an effect and is none, or looks like another one: own noise, noisy sources, steps, swings, ways."""

import os
from dataclasses import replace

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis import search as room
from delaytools.diagnosis import treads
from delaytools.diagnosis.added import Added, with_added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.diagnosis.driving import driven_best
from delaytools.diagnosis.fitting import Fitted, at_values
from delaytools.diagnosis.forward import _is_loud
from delaytools.diagnosis.forward import forward as on_the_way
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.pushes import as_measured, forces_on
from delaytools.diagnosis.screen import base_of
from delaytools.diagnosis.search import search
from delaytools.diagnosis.swings import swings
from delaytools.diagnosis.treads import within_steps
from delaytools.diagnosis.workers import workers
from delaytools.diagnosis.worth import OWN_NOISE, objection
from delaytools.signals.parameter import Parameter
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column, Multisine
from delaytools.simulation.simulate import simulate
from tests.diagnosis.small_cases import ACTUATOR, DRIVE, NOISE, SLIDE, fitted, planted

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)
LATE = Added("delay", "act.input", {"delay": 0.004})
EVERY = 2  # rows of a computer's period


def _read_back(case: Case, known: float) -> Case:
    """The case with a column that a computer writes from what is measured at the exit, of which it knows the signal."""
    (record,) = case.records
    measured, clean = case.measured[0][:, 0], case.outputs((), ())[0][:, 0]
    ticks = EVERY * (np.arange(len(record)) // EVERY)
    column = (-0.05 * (measured - known * clean))[ticks]
    log = Record(record.time, {**record.columns, "command": column}, record.units, record.held | {"command"})
    return replace(case, records=(log,), _replays={})


@pytest.mark.parametrize(("gain", "known"), [(0.0, 0.999), (0.3, 0.0)])
def test_a_coupling_that_pays_by_the_exits_own_noise_is_refused(gain: float, known: float) -> None:
    """A computer's output holds the noise of what it has just read; a coupling that is there pays late as well."""
    case = _read_back(planted(ACTUATOR, (), WAVE), known)
    if gain:
        true = gain * case.records[0]["command"]
        case = replace(case, measured=(case.measured[0] + true[:, None],))
    with_it = fitted(case, Added("cross_coupling", "act.output", {"gain": gain or -4.0}, {"source": "command"}))
    assert fitted(case).chi2 - with_it.chi2 > 150
    assert objection(case, fitted(case), with_it, Carried({})) == ("" if gain else OWN_NOISE)


BENCH = """
frame = "1 ms"
[signals]
u = "deg"
fin = "deg"
r = "deg/s"
y = "deg/s"
[blocks.actuator]
type = "second_order"
input = "u"
output = "fin"
natural_frequency = "150 rad/s"
damping = 0.6
[blocks.table]
type = "second_order"
input = "r"
output = "y"
natural_frequency = "300 rad/s"
damping = 0.7
[analysis]
at = "fin"
"""
SHAKEN = Added("flexible_mode", "table.output", {"gain": 5.0, "frequency": 40.0, "damping": 0.01}, {"source": "fin"})


def test_a_mode_does_not_ring_with_the_noise_of_its_source() -> None:
    """A fin moves a table's mode far above its own band: what its pick-off adds there shakes nothing."""
    design = parse_design(BENCH, "bench.toml")
    loop = build(design)
    drive = {"u": Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=9.0, lines=30), "r": WAVE}
    record = simulate(with_added(loop, (SHAKEN,)), drive, duration=10.0).record
    draw = np.random.default_rng(7)
    noisy = {name: record[name] + 0.02 * draw.standard_normal(len(record)) for name in ("fin", "y")}
    columns = {"u": record["u"], "r": record["r"], **noisy}
    log = Record(record.time, columns, {}, frozenset(), "run.csv")
    (one,) = diagnose(design, [log], effort=Effort(processes=1)).missing
    assert (one.effect, one.settings["source"], one.certain) == ("flexible_mode", "fin", True)
    assert one.parameters["frequency"].value == pytest.approx(40.0, abs=0.3)


def test_a_hypothesis_that_runs_away_says_nothing_of_noise() -> None:
    case = planted(DRIVE, (), WAVE, exit="v")
    away = fitted(case, Added("parameter_change:viscous", "drive", {"viscous": 9.0}))
    away = replace(away, added=(away.added[0].moved({"viscous": -400.0}),))
    away = replace(away, parameters=tuple(replace(p, value=-400.0) for p in away.parameters))
    (record,) = case.records
    quiet = {"u": record["u"] - 0.01 * np.random.default_rng(1).standard_normal(len(record))}
    columns = {"u": np.zeros((len(record), 0))}
    _, noises = driven_best(case, (quiet,), (columns,), {"u": case.whitening[0]}, {"v"}, under=away)
    assert noises["u"] is case.whitening[0]


def test_values_ahead_of_a_measured_quantiser_are_read_off_its_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(treads, "fit_hypothesis", lambda case, added, near: at_values(case, added, near))
    time = np.arange(0.0, 6.0005, 1e-3)
    command = Column(time=time, values=WAVE.value(time))
    rounded = Added("quantization", "act.output", {"step": 1.0}, {}, frozenset({"step"}))
    case = planted(ACTUATOR, (rounded,), command, noise=1e-3)
    free = Parameter("act.natural_frequency", 61.0, low=54.0, high=66.0)
    case = replace(case, tolerated=(free,), _replays={})
    before = at_values(case, (rounded,), Fitted((rounded,), (free,), np.zeros(0), np.zeros((0, 1))))
    after = within_steps(case, before)
    assert after.by_path[free.path].value == pytest.approx(60.0, abs=0.2)
    assert after.chi2 < 0.01 * before.chi2
    assert within_steps(case, after) is after or within_steps(case, after).chi2 <= after.chi2
    plain = fitted(case)
    assert within_steps(case, plain) is plain


def test_what_is_ahead_of_a_measured_quantiser_is_as_uncertain_as_its_steps_make_it() -> None:
    time = np.arange(0.0, 6.0005, 1e-3)
    command = Column(time=time, values=WAVE.value(time))
    gain, errors = Added("scale_factor", "act.input", {"factor": 1.3}), []
    for step in (1e-4, 1.0):
        rounded = Added("quantization", "act.output", {"step": step}, {}, frozenset({"step"}))
        errors.append(fitted(planted(ACTUATOR, (gain, rounded), command), gain, rounded).parameters[0].std)
    ratio = np.hypot(NOISE, 1.0 / np.sqrt(12)) / NOISE
    assert errors[1] / errors[0] == pytest.approx(ratio, rel=0.1)


def test_few_rows_rounded_the_other_way_are_worth_nothing_to_a_further_effect() -> None:
    """A gain of a thousandth sets five of them right, each worth more than a hundred of χ² by itself."""
    time = np.arange(0.0, 6.0005, 1e-3)
    rounded = Added("quantization", "act.output", {"step": 1.0}, {}, frozenset({"step"}))
    more = Added("scale_factor", "act.input", {"factor": 1.001})
    case = planted(ACTUATOR, (more, rounded), Column(time=time, values=WAVE.value(time)), noise=1e-3)
    before, after = fitted(case, rounded), fitted(case, more, rounded)
    assert before.chi2 - after.chi2 > 150
    assert objection(case, before, after, Carried({}), 0) != ""
    large = Added("scale_factor", "act.input", {"factor": 1.1})
    case = planted(ACTUATOR, (large, rounded), Column(time=time, values=WAVE.value(time)), noise=1e-3)
    assert objection(case, fitted(case, rounded), fitted(case, large, rounded), Carried({}), 0) == ""


def test_rows_that_are_rounded_the_other_way_are_not_loud() -> None:
    time = np.arange(0.0, 6.0005, 1e-3)
    rounded = Added("quantization", "act.output", {"step": 1.0})
    case = planted(ACTUATOR, (rounded,), Column(time=time, values=WAVE.value(time)), noise=1e-3)
    some = case.measured[0].copy()
    some[::400] += 1.0
    case = replace(case, measured=(some,))
    assert not _is_loud(case, fitted(case, rounded), Carried({}))
    assert _is_loud(case, fitted(case), Carried({}))


def test_swings_that_leave_nearly_as_little_are_all_tried() -> None:
    """Behind an integrating drive a swing's drift is like that of another one."""
    true = {"mean": 0.0045, "amplitude": 0.0019, "frequency": 0.79, "phase": -2.1}
    time = np.arange(0.0, 12.0005, 1e-3)
    force = np.random.default_rng(2).standard_normal(len(time) // 4 + 1).repeat(4)[: len(time)] * 20.0
    late = Added("variable_delay", "drive.u", true)
    case = planted(SLIDE, (late,), Column(time=time, values=force, held=True), noise=1e-4, seconds=12.0).roughly()
    found = [one.added.values["frequency"] for one in swings(base_of(case, fitted(case)), spots(case.segment))]
    assert min(abs(np.log(f / true["frequency"])) for f in found) < 0.15
    assert all(abs(np.log(a / b)) > 0.2 for k, a in enumerate(found) for b in found[:k])


def test_of_two_ways_the_one_that_leaves_less_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A play takes a hair more off than the friction that is there, and hides the rounding beside it."""
    case = planted(ACTUATOR, (Added("scale_factor", "act.output", {"factor": 1.2}), LATE), WAVE)
    begun = []

    def forward(way: room.Way, carried: Carried, *, most: int, begin: object = None) -> room.Way:
        found = on_the_way(way, carried, most=most, begin=begin)
        if begin is None and not way.fitted.added:
            lag = Added("lag", "act.input", {"time_constant": 0.004})
            offset = Added("bias", "act.output", {"level": 0.1})
            wrong = fitted(case, lag, offset)
            other = fitted(case, LATE)
            return replace(found, fitted=wrong, rivals=((), ()), alike=(other,))
        begun.append(begin)
        return found

    monkeypatch.setattr(room, "forward", forward)
    kinds = {one.kind for one in search(case, Carried({})).fitted.added}
    assert begun and kinds == {"scale_factor", "delay"}


def _threads(_: int) -> str | None:
    return os.environ.get("OPENBLAS_NUM_THREADS")


def test_processes_of_a_diagnosis_have_one_thread_each(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    with workers(2) as share:
        assert [found for _, found in share(_threads, [0])] == ["1"]
    assert _threads(0) is None


AIRFRAME = """
[signals]
u = "deg"
q = "deg/s"
[blocks.airframe]
type = "equations"
inputs = { fin = "u" }
states = { alpha = 0.0, q = 0.0 }
parameters = { lift = 1.1, moment = 120.0, stiffness = 58.0, damping = 1.5 }
rates = { alpha = "q - lift*alpha", q = "moment*fin - stiffness*alpha - damping*q" }
outputs = { q = "q" }
"""


def test_a_force_on_a_measured_state_needs_no_other_state() -> None:
    """What the block does without the force cancels: that a hidden angle acts as well hinders nothing."""
    force = Added("cubic_damping", "airframe.q'", {"coefficient": 0.01})
    case = planted(AIRFRAME, (), Multisine(amplitude=0.2, from_frequency=0.3, to_frequency=3.0, lines=9), exit="q")
    base = base_of(case, fitted(case))
    (rows,) = forces_on(base.view, force) or ((),)
    assert rows == pytest.approx(0.01 * as_measured(base.view, "q", 0) ** 3, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("late", [2, 400])
def test_a_sensor_of_an_exit_is_no_source(late: int) -> None:
    """Fed back, what shows the exit nearly as it is would make the model an observer, which follows any log."""
    case = planted(ACTUATOR, (), WAVE)
    (record,) = case.records
    sensed = np.concatenate([np.zeros(late), case.measured[0][:-late, 0]])
    log = Record(record.time, {**record.columns, "sensed": sensed}, record.units, record.held)
    case = replace(case, records=(log,), _replays={})
    assert "sensed" in base_of(case, fitted(case)).view.sources
    read = replace(case, read_by=frozenset({"sensed"}), _replays={})
    assert ("sensed" in base_of(read, fitted(read)).view.sources) == (late > 100)


def test_what_a_rounded_column_drives_is_explained() -> None:
    """The column is known to the row; when in a row it stepped, nobody knows, and no spline may swing about it."""
    design = parse_design(BENCH.replace('input = "r"', 'input = "fin"'), "bench.toml")
    loop = build(design)
    rounded = Added("quantization", "actuator.output", {"step": 0.5})
    drive = {"u": Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=4.0, lines=30)}
    record = simulate(with_added(loop, (rounded,)), drive, duration=5.0).record
    draw = np.random.default_rng(7)
    noisy = {name: record[name] + 0.01 * draw.standard_normal(len(record)) for name in ("fin", "y")}
    log = Record(record.time, {"u": record["u"], **noisy}, {}, frozenset(), "run.csv")
    found = diagnose(design, [log], effort=Effort(processes=1))
    assert [(one.effect, one.signal, one.certain) for one in found.missing] == [("quantization", "fin", True)]
    assert found.verdict == "missing"
