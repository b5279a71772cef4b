"""What a search begins from: whether noise drives a segment, forces along what was measured, how far chance goes."""

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis.added import Added, with_added
from delaytools.diagnosis.case import prepared_case
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.diagnosis.driving import joined_as_it_drove, nominal
from delaytools.diagnosis.heldout import HeldOut
from delaytools.diagnosis.screen import base_of
from delaytools.loop.segments import segments
from delaytools.signals.expression import Expression
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column, Formula, Multisine
from delaytools.simulation.simulate import simulate
from tests.diagnosis.small_cases import DRIVE, fitted, planted

READER = """
frame = "1 ms"
[signals]
w = "deg"
s = "deg"
u = "V"
[blocks.sensor]
type = "first_order"
input = "w"
output = "s"
time_constant = 0.02
[blocks.computer]
type = "sample_hold"
input = "0.5*s"
output = "u"
period = "2 ms"
"""


@pytest.mark.parametrize("late", [0, 1])
def test_a_computer_reads_the_noise_as_well_some_rows_late(late: int) -> None:
    design = parse_design(READER)
    wave = Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=5.0, lines=20)
    run = simulate(build(design), {"w": wave}, duration=1.5).record
    noisy = run["s"] + 0.05 * np.random.default_rng(3).standard_normal(len(run))
    read = np.concatenate([np.zeros(late), noisy])[: len(noisy)]
    held = np.repeat(0.5 * read[::2], 2)[: len(read)]
    log = Record(run.time, {"w": wave.value(run.time), "s": noisy, "u": held}, {"w": "deg", "s": "deg", "u": "V"})
    answer = diagnose(design, [log], effort=Effort(processes=1))
    if late == 0:
        assert answer.verdict == "adequate"
    else:
        (one,) = answer.missing
        assert (one.effect, one.signal) == ("delay", "u")
        assert one.parameters["delay"].value == pytest.approx(late * 1e-3, abs=2e-6)


def test_a_dead_band_that_swallows_the_noise_at_rest_does_not_hide_that_it_drives() -> None:
    design = parse_design(READER)
    push = Formula(formula=Expression("0.5*exp(-((t-0.4)/0.05)**2) - 0.25*exp(-((t-0.8)/0.05)**2)"))
    run = simulate(build(design), {"w": push}, duration=3.0).record
    noisy = run["s"] + 0.02 * np.random.default_rng(3).standard_normal(len(run))
    held = np.repeat(0.5 * noisy[::2], 2)[: len(noisy)]
    dead = held - np.clip(held, -0.1, 0.1)
    log = Record(run.time, {"w": push.value(run.time), "s": noisy, "u": dead}, {"w": "deg", "s": "deg", "u": "V"})
    answer = diagnose(design, [log], effort=Effort(processes=1))
    (one,) = answer.missing
    assert (one.effect, one.signal, one.certain, answer.verdict) == ("dead_band", "u", True, "missing")
    assert one.parameters["half_width"].value == pytest.approx(0.1, abs=1e-4)


def test_a_computer_that_loses_most_updates_reads_the_noise_of_those_that_arrive() -> None:
    design = parse_design(READER)
    wave = Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=5.0, lines=20)
    run = simulate(build(design), {"w": wave}, duration=3.0).record
    draws = np.random.default_rng(3)
    noisy = run["s"] + 0.05 * draws.standard_normal(len(run))
    ticks, lost = 0.5 * noisy[::2], draws.uniform(size=len(noisy[::2])) < 0.6
    for k in np.flatnonzero(lost):
        ticks[k] = ticks[k - 1] if k else 0.0
    held = np.repeat(ticks, 2)[: len(noisy)]
    log = Record(run.time, {"w": wave.value(run.time), "s": noisy, "u": held}, {"w": "deg", "s": "deg", "u": "V"})
    (one,) = diagnose(design, [log], effort=Effort(processes=1)).missing
    assert (one.effect, one.signal) == ("dropped_frames", "u")
    assert one.parameters["probability"].value == pytest.approx(lost.mean(), abs=2e-3)


def test_a_few_lost_updates_are_seen_beside_a_lag() -> None:
    design = parse_design(READER)
    wave = Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=5.0, lines=20)
    lag = Added("lag", "computer.input", {"time_constant": 0.0015})
    run = simulate(with_added(build(design), (lag,)), {"w": wave}, duration=3.0).record
    ticks, lost = run["u"][::2].copy(), np.random.default_rng(3).uniform(size=len(run["u"][::2])) < 0.01
    for k in np.flatnonzero(lost):
        ticks[k] = ticks[k - 1] if k else 0.0
    held = np.repeat(ticks, 2)[: len(run)]
    log = Record(run.time, {"w": run["w"], "s": run["s"], "u": held}, {"w": "deg", "s": "deg", "u": "V"})
    missing = {one.effect: one for one in diagnose(design, [log], effort=Effort(processes=1)).missing}
    assert set(missing) == {"lag", "dropped_frames"}
    assert missing["lag"].parameters["time_constant"].value == pytest.approx(0.0015, abs=1e-5)
    assert missing["dropped_frames"].parameters["probability"].value == pytest.approx(lost.mean(), abs=2e-3)


def test_a_force_along_the_measured_motion_is_all_that_is_missing_however_far_the_model_is() -> None:
    drag = Added("quadratic_drag", "drive.v'", {"coefficient": -20.0})
    wave = Multisine(amplitude=40.0, from_frequency=0.2, to_frequency=2.0, lines=12)
    case = planted(DRIVE, (drag,), wave, exit="v", noise=0.0)
    base = base_of(case, fitted(case))
    missing = case.measured[0] - base.outputs[0]
    moved = base.moved_by(drag)
    own_motion = case.outputs((drag,), (-20.0,))[0] - base.outputs[0]
    assert float(np.std(missing)) > 0.3 * float(np.std(case.measured[0]))
    assert moved is not None and np.abs(moved[0] - missing).max() < 1e-3 * np.abs(missing).max()
    assert np.allclose(own_motion, missing, atol=1e-3 * float(np.abs(missing).max()))
    half = base.moved_by(drag.moved({"coefficient": -10.0}))
    assert half is not None and np.allclose(2 * half[0], moved[0])


def test_luck_is_what_the_rows_that_get_worse_say() -> None:
    def of(residual: np.ndarray) -> HeldOut:
        return HeldOut(residual, np.array([float(residual @ residual)]))

    spikes, plain = np.zeros(1000), np.zeros(1000)
    spikes[::100], plain[50::100] = 10.0, 10.0
    gain, _ = of(plain).better_than(of(spikes))
    assert gain == 0.0 and of(plain).luck_beside(of(spikes)) == pytest.approx(np.sqrt(2 * 10) * 100)
    assert of(np.zeros(1000)).luck_beside(of(spikes)) == 0.0


SENSOR = """
frame = "1 ms"
[signals]
x = "deg/s"
y = "deg/s"
[blocks.sensor]
type = "second_order"
input = "x"
output = "y"
natural_frequency = "400 rad/s"
damping = 0.65
"""


@pytest.mark.parametrize("curved", [True, False])
def test_rows_of_a_fast_entry_are_joined_as_what_drove(curved: bool) -> None:
    """94 Hz at 1 ms: straight lines take 3 % off. What drove was the wave, or straight lines between its rows."""
    loop = build(parse_design(SENSOR))
    wave = Formula(formula=Expression("2*sin(2*pi*0.7*t) + 0.7*sin(2*pi*94.3*t + 0.4)"))
    time = 1e-3 * np.arange(4001)
    rows = wave.value(time)
    run = simulate(loop, {"x": wave if curved else Column(time=time, values=rows)}, duration=4.0).record
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(run))
    log = Record(time, {"x": rows, "y": run["y"] + noise}, {"x": "deg/s", "y": "deg/s"})
    (part,) = segments(loop, {"x", "y"})
    case = prepared_case(part, (log,), (), frozenset())
    found = joined_as_it_drove(case, "x", nominal(case))
    assert ("x" in found.smooth) is curved
