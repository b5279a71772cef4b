"""Where loops rest, and that what is asked of them is asked about that rest."""

import numpy as np
import pytest

from delaytools.analysis.disk_margins import loop_disk_margin
from delaytools.analysis.questions import loop_margins, loop_roots
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.loop.edit import held_at
from delaytools.loop.loop import Loop
from delaytools.loop.trim import trim
from delaytools.signals.stimulus import Step
from delaytools.signals.trouble import AnalysisError, DesignError
from delaytools.simulation.simulate import simulate

AXIS = """
title = "An axis on a spring that hardens, 0.5 per deg^3"
frame = "1 ms"
[signals]
demand = "deg"
angle = "deg"
[blocks.controller]
type = "gain"
input = "20*(demand - seen) - 6*rate"
output = "command"
[blocks.sensor]
SENSOR
input = "angle"
output = "seen"
[blocks.late]
type = "delay"
input = "command"
output = "torque"
delay = "20 ms"
[blocks.axis]
type = "equations"
inputs = { u = "torque" }
states = { q = 0.0, v = 0.0 }
rates = { q = "v", v = "u + PUSH - (SPRING)" }
outputs = { angle = "q", rate = "v" }
"""
SENSORS = {
    "continuous": 'type = "second_order"\nnatural_frequency = "300 rad/s"\ndamping = 0.7',
    "sampled": 'type = "sample_hold"\nperiod = "5 ms"',
}
HARD = "4*q + 0.5*q**3"


def axis(sensor: str, spring: str = HARD, push: float = 0.0) -> Loop:
    text = AXIS.replace("SENSOR", SENSORS[sensor]).replace("SPRING", spring).replace("PUSH", repr(push))
    return build(parse_design(text))


def tangent(sensor: str, angle: float) -> Loop:
    """The loop whose spring is the tangent of the hard one at an angle."""
    return axis(sensor, f"{4 + 1.5 * angle**2!r}*q")


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_wanted_angle_is_held_by_what_the_spring_asks(sensor: str) -> None:
    found = trim(axis(sensor), wanted={"angle": 2.0}, by=["demand"])
    torque = 4 * 2.0 + 0.5 * 2.0**3
    assert found.inputs == pytest.approx({"demand": 2.0 + torque / 20})
    wanted = {"demand": 2.6, "seen": 2.0, "command": torque, "torque": torque, "angle": 2.0, "rate": 0.0}
    assert found.signals == pytest.approx(wanted, abs=1e-12)
    assert found.states["axis.q"] == pytest.approx(2.0) and found.is_off_zero
    again = trim(found.loop)
    assert again.signals == pytest.approx(found.signals, abs=1e-9)
    assert trim(again.loop, wanted={"angle": 1.0}, by=["demand"]).inputs == pytest.approx({"demand": 1.225})


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_run_comes_to_the_rest(sensor: str) -> None:
    found = trim(axis(sensor), {"demand": 3.0})
    record = simulate(axis(sensor), {"demand": Step(amplitude=3.0)}, duration=12.0).record
    for name in ("angle", "command", "seen"):
        assert record[name][-1] == pytest.approx(found.signals[name], rel=1e-9)


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("at", ["command", "angle", "seen"])
@pytest.mark.parametrize("delay_at", [None, "axis.u"])
def test_margins_and_roots_are_those_of_the_tangent_at_rest(sensor: str, at: str, delay_at: str | None) -> None:
    for loop, rest in (
        (held_at(axis(sensor), {"demand": 3.0}), trim(axis(sensor), {"demand": 3.0}).signals["angle"]),
        (axis(sensor, push=40.0), trim(axis(sensor, push=40.0)).signals["angle"]),  # no input held: it pushes itself
    ):
        assert rest > 1.0
        found, wanted = (
            loop_margins(one, at, [0.0, 0.01], delay_at=delay_at).margins for one in (loop, tangent(sensor, rest))
        )
        for one, other in zip(found, wanted, strict=True):
            assert one.gain_margin == pytest.approx(other.gain_margin, rel=1e-9)
            assert one.delay_margin == pytest.approx(other.delay_margin, rel=1e-9)
        roots, known = (
            loop_roots(one, at, delays=[0.01], delay_at=delay_at).sets[0].roots for one in (loop, tangent(sensor, rest))
        )
        assert np.abs(roots[:4] - known[:4]).max() < 1e-7 * np.abs(known[:4]).max()
    level = loop_margins(axis(sensor), at, [0.0], delay_at=delay_at).margins[0]
    assert level.delay_margin != pytest.approx(wanted[0].delay_margin, rel=1e-3)


def test_disk_margins_of_several_signals_are_about_the_rest() -> None:
    loop = axis("continuous", push=40.0)
    rest = trim(loop).signals["angle"]
    found, wanted = (loop_disk_margin(one, ["torque", "seen"]) for one in (loop, tangent("continuous", rest)))
    assert found.margin == pytest.approx(wanted.margin, rel=1e-6)
    assert found.margin != pytest.approx(loop_disk_margin(axis("continuous"), ["torque", "seen"]).margin, rel=1e-3)


def test_a_loop_that_rests_at_zero_says_so() -> None:
    assert not trim(axis("continuous")).is_off_zero


def test_what_cannot_be_trimmed_is_said() -> None:
    loop = axis("continuous")
    with pytest.raises(AnalysisError, match="one input is sought for each"):
        trim(loop, wanted={"angle": 1.0})
    with pytest.raises(AnalysisError, match="held or sought"):
        trim(loop, {"demand": 1.0}, wanted={"angle": 1.0}, by=["demand"])
    with pytest.raises(AnalysisError, match="comes to no rest"):
        trim(loop, wanted={"rate": 1.0}, by=["demand"])
    for given in ({"held": {"angle": 1.0}}, {"wanted": {"angel": 1.0}, "by": ["demand"]},
                  {"wanted": {"angle": 1.0}, "by": ["rate"]}):  # fmt: skip
        with pytest.raises(DesignError):
            trim(loop, **given)  # type: ignore[arg-type]
