"""What logs leave open: values of other segments, ends of tolerances, the tick of an edge, breakaway friction."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.answer import Missing, Unexplained
from delaytools.diagnosis.diagnose import _as_sure_as
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.nuisance import with_nuisance_of
from delaytools.diagnosis.screen import base_of
from delaytools.diagnosis.segment_report import ALIKE, SegmentReport, _directions
from delaytools.diagnosis.stepwise import with_period_fitted
from delaytools.diagnosis.upgrades import breaking_away_as_well
from delaytools.diagnosis.windows import _at_ticks
from delaytools.diagnosis.worth import UNKNOWN, objection
from delaytools.signals.parameter import Parameter
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import ACTUATOR, DRIVE, fitted, planted

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)
PUSH = Multisine(amplitude=10.0, from_frequency=0.3, to_frequency=6.0, lines=25)
LIGHT = ACTUATOR.replace("60 rad/s", "20 rad/s").replace("damping = 0.6", "damping = 0.02")
SAMPLED = """
[signals]
u = "deg"
d = "deg"
x = "deg"
[blocks.computer]
type = "sample_hold"
input = "u"
output = "d"
period = "5 ms"
[blocks.act]
type = "second_order"
input = "d"
output = "x"
natural_frequency = "60 rad/s"
damping = 0.6
"""


def coulomb(level: float) -> Added:
    return Added("coulomb_friction", "drive.v'", {"level": level, "smoothing": 0.02})


def stribeck(level: float, stiction: float, speed: float) -> Added:
    values = {"level": level, "stiction": stiction, "speed": speed, "smoothing": 0.02}
    return Added("stribeck_friction", "drive.v'", values)


def test_what_an_uncertain_input_does_is_told_by_the_hypothesis() -> None:
    """Against a run on the shifted log; and a value that is 3 % off makes another answer of a light mode."""
    free = (Parameter("act.natural_frequency", 20.6, low=18.0, high=22.0),)
    case = replace(planted(LIGHT, (), WAVE), tolerated=free, _replays={})
    shift = 0.01 * np.gradient(case.records[0]["u"], case.step)
    case = replace(case, uncertain=({"u": shift[:, None]},))
    best = fitted(case)
    found = with_nuisance_of(case, best).nuisance[0][:, :, 0]
    log = case.records[0]
    moved = Record(log.time, {**log.columns, "u": log["u"] + shift}, log.units, log.held)
    again = replace(case, records=(moved,), _replays={})
    values = best.values
    expected = again.outputs((), values)[0] - case.outputs((), values)[0]
    assert np.allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    rough = Fitted((), case.parameters(()), np.zeros(0), np.zeros((0, 1)))
    designed = with_nuisance_of(case, rough).nuisance[0][:, :, 0]
    assert np.linalg.norm(designed - found) > 0.3 * np.linalg.norm(found)


def test_no_uncertain_values_are_no_nuisance() -> None:
    case = replace(planted(LIGHT, (), WAVE), uncertain=({"u": np.zeros((6001, 0))},))
    assert with_nuisance_of(case, fitted(case)) is case


def test_a_tolerated_value_on_its_end_is_not_known() -> None:
    """The frequency lies on the low end of its tolerance, since a lag of 2 ms that is not asked for slows the rest."""
    true = Added("delay", "act.input", {"delay": 0.004})
    text = ACTUATOR.replace("60 rad/s", "70 rad/s")
    case = planted(text, (true, Added("lag", "act.input", {"time_constant": 0.002})), WAVE)
    free_one = Parameter("act.natural_frequency", 70.0, low=69.0, high=80.0)
    open_ended = replace(case, tolerated=(free_one,), _replays={})
    one = Added("delay", "act.input", {"delay": 0.003})
    known, free = (fitted(c, one).by_path["effects.1000.delay"] for c in (case, open_ended))
    frequency = fitted(open_ended, one).by_path["act.natural_frequency"]
    assert frequency.value == pytest.approx(69.0, abs=0.1) and np.isnan(frequency.std)
    assert free.std > 5 * known.std


@pytest.mark.parametrize(
    ("at", "place", "rows"),
    [("computer.output", 2.005, 5), ("computer.output", 2.007, 0), ("act.output", 2.005, 0)],
)
def test_an_edge_at_a_tick_of_what_writes_the_signal_may_be_older(at: str, place: float, rows: int) -> None:
    base = base_of(case := planted(SAMPLED, (), WAVE), fitted(case))
    assert _at_ticks(base, at, (place, 3e-4)) == pytest.approx(np.hypot(3e-4, rows * 1e-3 / np.sqrt(3)))


def test_a_period_beyond_the_first_range_is_found() -> None:
    held = Added("sample_hold", "act.input", {"period": 0.012}, {}, frozenset({"period"}))
    case = planted(ACTUATOR, (held,), WAVE, noise=1e-4)
    found = with_period_fitted(base_of(case, fitted(case)), held.moved({"period": 0.004}))
    assert found.added.values["period"] == pytest.approx(0.012)


@pytest.mark.parametrize(
    ("true", "alike"),
    [(coulomb(1.0), False), (stribeck(0.01, 0.016, 0.3), True), (coulomb(0.005), True)],
)
def test_breakaway_that_a_log_cannot_exclude_stands_beside_coulomb_friction(true: Added, alike: bool) -> None:
    case = planted(DRIVE.replace('v = "v"', 'x = "v"'), (true,), PUSH)
    best = fitted(case, coulomb(max(true.values["level"], 1e-3)))
    other = breaking_away_as_well(case, best, 0)
    assert other is not None and other.added[-1].values["stiction"] >= 1.5 * best.added[0].values["level"] * (1 - 1e-6)
    assert (other.chi2 < best.chi2 + ALIKE) == alike


def test_an_effect_of_whose_value_the_log_says_nothing_is_not_named() -> None:
    lag = Added("lag", "act.input", {"time_constant": 0.002})
    case = planted(ACTUATOR, (lag,), WAVE)
    before, best = fitted(case), fitted(case, lag)
    assert objection(case, before, best, Carried({})) == ""
    unknown = replace(best, parameters=tuple(replace(p, std=np.inf) for p in best.parameters))
    assert objection(case, before, unknown, Carried({})) == UNKNOWN


def test_what_a_rival_does_instead_is_passed_on_as_not_known() -> None:
    lag, late = Added("lag", "act.input", {"time_constant": 0.002}), Added("delay", "act.input", {"delay": 0.002})
    case = planted(ACTUATOR, (lag,), WAVE)
    best, rival = fitted(case, lag), fitted(case, late)
    found = _directions(case, best, [(rival,)])[0][:, :, -1]
    outputs = [case.outputs(one.added, one.values)[0] for one in (best, rival)]
    assert np.allclose(found, outputs[1] - outputs[0]) and np.std(found) > 0


@pytest.mark.parametrize(("told", "sure"), [("u", False), ("elsewhere", True)])
def test_nothing_is_certain_behind_what_is_not_explained(told: str, sure: bool) -> None:
    part = planted(ACTUATOR, (), WAVE).segment
    one = Missing("lag", "act.input", "x", {}, {}, True, ())
    unknown = Unexplained(told, 0.3, (), "")
    nothing: tuple[tuple[Any, ...], ...] = ((),) * 4
    ahead = SegmentReport(("u",), *nothing[:3], (), (), (), (), (unknown,), {}, (), False)
    behind = SegmentReport(("x",), *nothing[:3], (one,), (), (), (), (), {}, (), False)
    assert _as_sure_as(behind, part, {0: ahead}).missing[0].certain == sure
