"""Where a first choice misleads: another beginning, friction beside friction, loudness, sets of one kind."""

import time
from dataclasses import replace

import numpy as np
import pytest

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.attempts import fits
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.diagnose import SEARCHED, Effort, _ends
from delaytools.diagnosis.fitting import fit_hypothesis
from delaytools.diagnosis.noise_of import Carried, is_loud
from delaytools.diagnosis.quantities import quantities
from delaytools.diagnosis.search import Finding, _swapped, search
from delaytools.diagnosis.second_look import begun_again
from delaytools.diagnosis.segment_report import _spread_over
from delaytools.diagnosis.upgrades import breaking_away_as_well
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import ACTUATOR, NOISE, SLIDE, fitted, planted
from tests.diagnosis.test_what_hides import CARRIAGE, PUSH, found

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)
GAIN = Added("scale_factor", "act.output", {"factor": 1.2})
LATE = Added("delay", "act.input", {"delay": 0.008})


def _wanting(case: Case) -> Finding:
    """What a search might have found that took a delay first."""
    nothing = tuple(np.zeros(len(m)) for m in case.measured)
    late = fitted(case, Added("delay", "act.output", {"delay": 0.002}))
    return Finding(case, fitted(case), late, ((),), None, nothing, False, (fitted(case, GAIN),))


def test_what_leaves_something_is_begun_again_with_the_next_best() -> None:
    case = planted(ACTUATOR, (GAIN, LATE), WAVE)
    answer = begun_again(_wanting(case), case, Carried({}), deadline=time.monotonic() + 100)
    first, second = answer.fitted.added
    assert (first.kind, second.kind) == ("scale_factor", "delay")
    assert first.values["factor"] == pytest.approx(1.2, abs=1e-3)


def test_what_explains_all_or_has_no_time_left_stands() -> None:
    case = planted(ACTUATOR, (GAIN,), WAVE)
    wanting = _wanting(case)
    right = replace(wanting, fitted=fitted(case, GAIN))
    assert begun_again(right, case, Carried({}), deadline=time.monotonic() + 100) is right
    assert begun_again(wanting, case, Carried({}), deadline=time.monotonic() - 1) is wanting


def test_a_search_says_with_what_it_might_have_begun() -> None:
    found = search(planted(ACTUATOR, (GAIN, LATE), WAVE), Carried({}))
    kinds = {one.added[0].kind for one in found.beginnings}
    assert {one.kind for one in found.fitted.added} == {"scale_factor", "delay"}
    assert kinds and found.fitted.added[0].kind not in kinds


def test_a_load_friction_beside_coulomb_begins_gently() -> None:
    true = (
        Added("coulomb_friction", "drive.v'", {"level": 2.0, "smoothing": 0.02}),
        Added("load_dependent_friction", "drive.v'", {"coefficient": 0.4, "smoothing": 0.02}),
    )
    case = planted(SLIDE, true, Multisine(amplitude=40.0, from_frequency=0.2, to_frequency=2.0, lines=12), noise=1e-3)
    alone = fit_hypothesis(case, (true[0],))
    locking = true[1].moved({"coefficient": 1.5, "smoothing": 0.002})
    (best, *_) = fits(case, alone, [((*alone.added, locking), 0.5 * alone.chi2)])
    assert best.chi2 < 1.2 * len(best.residual) < 0.5 * alone.chi2
    assert best.added[-1].values["coefficient"] == pytest.approx(0.4, rel=0.05)


def test_loud_is_what_neither_coloured_noise_nor_the_noise_of_inputs_may_be() -> None:
    case = planted(ACTUATOR, (), WAVE)
    rows = np.random.default_rng(5).standard_normal(len(case.measured[0]))
    assert not is_loud(case, 0, 4 * NOISE * rows, 0.0) and is_loud(case, 0, 6 * NOISE * rows, 0.0)
    assert not is_loud(case, 0, 6 * NOISE * rows, 4 * NOISE) and is_loud(case, 0, 12 * NOISE * rows, 4 * NOISE)


def test_two_places_of_one_kind_that_say_something_else_are_a_set() -> None:
    """A position pick-off that reads 3 % less, or a rate that reads 3 % more: the gain between them is free."""
    table = {"type": "scale_factor", "at": "drive.x", "factor": 0.97}
    answer = found(CARRIAGE, (table,), {"r": PUSH}, {"x": 0.01, "v": 0.1})
    claims = {(one.effect, one.at) for c in answer.confusable for one in c.members}
    assert {("scale_factor", "drive.x"), ("scale_factor", "drive.v")} <= claims
    assert not any(one.certain for one in answer.missing)


def test_what_a_swap_takes_out_stays_a_rival() -> None:
    case = planted(ACTUATOR, (GAIN, LATE), WAVE)
    lag = Added("lag", "act.input", {"time_constant": 0.008})
    _, answer, rivals = _swapped(case, fitted(case, lag, GAIN), [[], []], Carried({}), everything=False)
    assert [one.kind for one in answer.added] == ["delay", "scale_factor"]
    assert "lag" in [one.added[-1].kind for one in rivals[0]]


def test_a_value_is_as_uncertain_as_what_stands_beside_it() -> None:
    case = planted(ACTUATOR, (GAIN, LATE), WAVE)
    lag = Added("lag", "act.input", {"time_constant": 0.008})
    mine, rival = fitted(case, GAIN, LATE), fitted(case, GAIN, lag)
    own = quantities(case.segment.loop, mine, 0)
    apart = abs(rival.added[0].values["factor"] - mine.added[0].values["factor"])
    assert _spread_over(own, mine.added[0], [])["factor"] == own["factor"]
    wide = _spread_over(own, mine.added[0], [rival])["factor"]
    assert wide.std == pytest.approx(np.hypot(own["factor"].std, apart / np.sqrt(3))) and apart > own["factor"].std


def test_a_segment_that_waits_keeps_a_part_of_the_budget() -> None:
    one, two = Effort(processes=1, budget=100.0), Effort(processes=2, budget=100.0)
    ends = _ends([[2, 0], [1]], 1000.0, one)
    assert ends[1] == 1000.0 + 100.0 * SEARCHED and ends[2] < ends[0] < ends[1]
    beside = _ends([[2, 0], [1]], 1000.0, two)
    assert beside[1] == ends[1] and beside[2] == beside[0] == ends[0]
    assert min(_ends([list(range(40))], 1000.0, one).values()) > 1000.0 + 0.4 * 100.0 * SEARCHED


def test_coulomb_friction_in_a_slow_motion_has_a_rival_that_breaks_away() -> None:
    slow = Multisine(amplitude=4.0, from_frequency=0.2, to_frequency=1.0, lines=8)
    friction = Added("coulomb_friction", "drive.v'", {"level": 1.0, "smoothing": 0.1})
    case = planted(SLIDE, (friction,), slow, noise=0.05)
    alone = fit_hypothesis(case, (friction,))
    rival = breaking_away_as_well(case, alone, 0)
    assert rival is not None and rival.chi2 < alone.chi2 + 12.0
    one = rival.added[-1]
    assert one.kind == "stribeck_friction" and one.values["stiction"] > 1.4 * one.values["level"]
