"""Effects that make rows jump as a whole: what a fit is told of them, and a few rows that fall on the other side."""

from dataclasses import replace

import numpy as np
import pytest

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis
from delaytools.diagnosis.noise import LARGEST, ORDER, without_odd_rows
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.proposals import sharpened_again
from delaytools.diagnosis.quantisers import quantisations
from delaytools.diagnosis.screen import base_of
from delaytools.diagnosis.search import search
from delaytools.diagnosis.segment_report import _directions, segment_report
from delaytools.diagnosis.stepwise import with_period_fitted
from delaytools.signals.parameter import Parameter
from delaytools.signals.stimulus import Column, Multisine
from tests.diagnosis.small_cases import ACTUATOR, NOISE, SLIDE, fitted, planted

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)
TIME = np.arange(0.0, 6.0005, 1e-3)
COMMAND = Column(time=TIME, values=WAVE.value(TIME), held=True)
STEP, PATH = 0.5, "act.natural_frequency"


def rounded(at: str, step: float = STEP, error: float = 0.0) -> Added:
    return Added("quantization", at, {"step": step}, {}, frozenset({"step"}), {}, {"step": error} if error else {})


def free_frequency(case: Case, start: float) -> Case:
    """The case with the actuator's natural frequency free from `start`; true is 60 rad/s."""
    return replace(case, tolerated=(Parameter(PATH, start, low=50.0, high=70.0),), _replays={})


def with_odd_row(case: Case, row: int) -> Case:
    measured = case.measured[0].copy()
    measured[row] += STEP
    return replace(case, measured=(measured,), _replays={})


def test_a_fit_moves_what_stands_ahead_of_a_quantiser() -> None:
    case = free_frequency(planted(ACTUATOR, (rounded("act.output"),), WAVE), 57.0)
    found = fit_hypothesis(case, (rounded("act.output"),))
    assert found.by_path[PATH].value == pytest.approx(60.0, abs=0.1)


def test_few_rows_far_out_are_cut_and_many_are_not() -> None:
    rows = np.random.default_rng(1).standard_normal(4000)
    assert np.array_equal(without_odd_rows(rows), rows)
    rows[[7, 900]] = [40.0, -25.0]
    cut = without_odd_rows(rows)
    assert set(np.flatnonzero(cut != rows)) == {7, 900} and 5.5 < cut[7] == -cut[900] < 6.5
    rows[:400] = 30.0
    assert np.array_equal(without_odd_rows(rows), rows)


def test_a_row_on_the_other_side_costs_what_noise_may_and_moves_nothing() -> None:
    case = free_frequency(planted(ACTUATOR, (rounded("act.output"),), WAVE), 60.0)
    one = (rounded("act.output"),)
    plain, odd = fit_hypothesis(case, one), fit_hypothesis(with_odd_row(case, 3210), one)
    assert odd.chi2 - plain.chi2 < (ORDER + 1) * LARGEST**2 < (STEP / NOISE) ** 2  # the filter smears a row
    assert odd.by_path[PATH].value == pytest.approx(plain.by_path[PATH].value, abs=plain.by_path[PATH].std)
    assert odd.by_path[PATH].std == pytest.approx(plain.by_path[PATH].std, rel=0.1)
    noises = [noise_of(c, f, Carried({}))[0].rms for c, f in ((case, plain), (with_odd_row(case, 3210), odd))]
    assert noises[1] == pytest.approx(noises[0], rel=0.01)


def test_odd_rows_ask_for_no_effect_and_leave_the_step_as_it_is() -> None:
    case = planted(ACTUATOR, (rounded("act.output"),), WAVE)
    for row in (1234, 3210):
        case = with_odd_row(case, row)
    report = segment_report(search(case, Carried({})))
    assert [(one.effect, one.at) for one in report.missing] == [("quantization", "act.output")]
    step = report.missing[0].parameters["step"]
    assert abs(step.value - STEP) < 3 * (step.std or 0.0) < 0.01 * STEP
    assert not report.unexplained


def test_a_step_and_a_value_ahead_of_it_are_found_in_turn() -> None:
    case = free_frequency(planted(ACTUATOR, (rounded("act.input"),), WAVE), 60.0)
    far = fit_hypothesis(case, (rounded("act.input", 1.006 * STEP, 5e-4),), tolerance=1e-4)
    near = sharpened_again(case, far)
    assert far.chi2 > near.chi2 + 100.0
    assert near.added[0].values["step"] == pytest.approx(STEP, rel=1e-3)


def test_a_step_ahead_of_what_integrates_is_found_among_those_that_go_with_its_drift() -> None:
    case = planted(SLIDE, (rounded("drive.u"),), COMMAND, exit="x", noise=0.001)
    found = quantisations(base_of(case, fitted(case)), fitted_view(case), spots(case.segment))
    best = max(found, key=lambda one: one.gain)
    assert best.added.at == "drive.u" and best.added.values["step"] == pytest.approx(STEP, rel=2e-3)


def fitted_view(case: Case) -> object:
    return base_of(case, fitted(case)).view


def test_a_period_far_below_the_first_guess_is_found() -> None:
    held = Added("sample_hold", "drive.u", {"period": 0.013}, {}, frozenset({"period"}))
    case = planted(SLIDE, (held,), COMMAND, exit="x", noise=0.001)
    found = with_period_fitted(base_of(case, fitted(case)), held.moved({"period": 0.026}))
    assert found.added.values["period"] == pytest.approx(0.013)


def test_a_wrong_step_moves_what_is_driven_by_the_exit() -> None:
    """The error of a value that no fit moves is passed on to the next segment like those of the others."""
    case = planted(ACTUATOR, (rounded("act.input"),), WAVE)
    plain = Fitted((rounded("act.input"),), (), np.zeros(1), np.zeros((1, 0)))
    unsure = replace(plain, added=(rounded("act.input", error=1e-3),))
    assert _directions(case, plain)[0].shape[2] == 0
    assert float(np.std(_directions(case, unsure)[0][:, 0, 0])) > 0


def test_a_row_that_an_input_jumps_between_is_no_reason_for_an_effect() -> None:
    jump = Column(time=TIME, values=WAVE.value(TIME) + 2.0 * (TIME > 3.2))
    case = replace(planted(ACTUATOR, (), jump), smooth=frozenset({"u"}), _replays={})
    odd = with_odd_row(case, 3205)
    assert odd.is_driven_by_jumps
    assert fitted(odd).chi2 - fitted(case).chi2 < (ORDER + 1) * LARGEST**2 < (STEP / NOISE) ** 2
    assert not search(odd, Carried({})).fitted.added
