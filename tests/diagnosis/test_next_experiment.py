"""The next experiment is the one that an engineer would choose, stays within what the logs showed, and decides."""

import time

import numpy as np
import pytest

from delaytools.design.inputs import Setting, stimulus
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.answer import NextExperiment
from delaytools.diagnosis.next_experiment import DECISIVE, next_experiment
from delaytools.signals.stimulus import Sine
from tests.diagnosis.small_cases import ACTUATOR, CHAIN, DRIVE, fitted, planted

PEAK = 2.0
LATE = Added("delay", "act.input", {"delay": 0.006})
LAG = Added("lag", "act.input", {"time_constant": 0.006})
BAND = Added("dead_band", "act.input", {"half_width": 0.02})
PLAY = Added("backlash", "act.input", {"half_width": 0.02})
FRICTION = Added("coulomb_friction", "act.rate'", {"level": 50.0, "smoothing": 0.2})
LIMIT = Added("rate_limit", "act.input", {"limit": 24.0})
SHORT_LAG = Added("lag", "act.input", {"time_constant": 0.002})
GAIN = Added("scale_factor", "act.output", {"factor": 1.1})
SENSOR = Added("scale_factor", "sensor.output", {"factor": 1.1})
STAMPED = Added("delay", "sensor.input", {"delay": 0.006})
DRIVE_FRICTION = Added("coulomb_friction", "drive.v'", {"level": 0.02, "smoothing": 0.01})
DRIVE_PLAY = Added("backlash", "drive.u", {"half_width": 0.02})


def chosen(text: str, pair: tuple[Added, Added], frequency: float, exit: str = "x") -> NextExperiment:
    """What is suggested after a log of one sine."""
    true, other = pair
    case = planted(text, (true,), Sine(amplitude=PEAK, frequency=frequency), exit=exit)
    best, rival = fitted(case, true), fitted(case, other)
    begin = time.monotonic()
    found = next_experiment(case, best, (rival,))
    assert time.monotonic() - begin < 20
    assert found is not None
    assert true.kind in found.why and other.kind in found.why
    return found


def formula_peak(found: NextExperiment) -> float:
    """Largest value of the suggested input."""
    table = {key: raw for key, raw in found.input.items() if key != "signal"}
    return float(np.abs(stimulus(table, Setting()).value(np.linspace(0, 20, 20001))).max())


@pytest.mark.parametrize("pair", [(LATE, LAG), (LAG, LATE)], ids=["delay", "lag"])
def test_delay_or_lag_asks_for_a_higher_frequency(pair: tuple[Added, Added]) -> None:
    found = chosen(ACTUATOR, pair, 1.0)
    assert found.input["type"] == "sine" and found.input["frequency"] > 4.0
    assert found.input["signal"] == "u" and found.expected_delta_chi2 > DECISIVE


@pytest.mark.parametrize("pair", [(BAND, PLAY), (PLAY, BAND)], ids=["dead band", "backlash"])
def test_dead_band_or_backlash_asks_for_a_small_oscillation_about_a_bias(pair: tuple[Added, Added]) -> None:
    found = chosen(ACTUATOR, pair, 1.0)
    assert "about a bias" in found.why and "min(t, 1) + " in found.input["formula"]
    assert formula_peak(found) <= PEAK * (1 + 1e-6) and found.expected_delta_chi2 > DECISIVE


@pytest.mark.parametrize(
    "pair", [(DRIVE_FRICTION, DRIVE_PLAY), (DRIVE_PLAY, DRIVE_FRICTION)], ids=["friction", "play"]
)
def test_friction_or_backlash_of_a_drive_asks_for_a_slow_triangle(pair: tuple[Added, Added]) -> None:
    found = chosen(DRIVE, pair, 4.0, "v")
    assert "slow triangle" in found.why and found.expected_delta_chi2 > DECISIVE
    assert formula_peak(found) <= PEAK * (1 + 1e-6)


def test_friction_in_a_position_servo_is_play_when_slow_so_it_asks_for_more_speed() -> None:
    """The spring of a servo turns friction into play of level/ωn²: a slow triangle shows no difference at all."""
    found = chosen(ACTUATOR, (FRICTION, PLAY), 2.0)
    assert "triangle" not in found.why and found.expected_delta_chi2 > DECISIVE


@pytest.mark.parametrize("pair", [(LIMIT, SHORT_LAG), (SHORT_LAG, LIMIT)], ids=["rate limit", "lag"])
def test_rate_limit_or_lag_asks_for_double_the_amplitude(pair: tuple[Added, Added]) -> None:
    found = chosen(ACTUATOR, pair, 2.0)
    assert "double the amplitude" in found.why
    assert found.input["amplitude"] == pytest.approx(2 * PEAK) and found.input["type"] == "sine"


def test_gain_or_sensor_scale_asks_for_the_signal_between() -> None:
    found = chosen(CHAIN, (GAIN, SENSOR), 2.0, "y")
    assert found.input == {"measure": ["x"]} and "measure x as well" in found.why
    assert found.expected_delta_chi2 == 0.0


def test_clock_offset_or_delay_asks_for_a_loop_back_pulse() -> None:
    found = chosen(CHAIN, (LATE, STAMPED), 2.0, "y")
    assert found.input["type"] == "pulse" and "loop-back" in found.why and "clocks" in found.why


def test_the_expected_figure_is_what_the_run_then_shows() -> None:
    """χ² of the rival on a run of the suggested input, less that of the truth, is what was promised."""
    case = planted(ACTUATOR, (LATE,), Sine(amplitude=PEAK, frequency=1.0))
    found = next_experiment(case, fitted(case, LATE), (fitted(case, LAG),))
    assert found is not None
    table = {key: raw for key, raw in found.input.items() if key != "signal"}
    run = planted(ACTUATOR, (LATE,), stimulus(table, Setting()), seconds=20.0)
    shown = fitted(run, LAG).chi2 - fitted(run, LATE).chi2
    assert shown == pytest.approx(found.expected_delta_chi2, rel=0.15)


def test_nothing_to_decide() -> None:
    case = planted(ACTUATOR, (LATE,), Sine(amplitude=PEAK, frequency=1.0))
    assert next_experiment(case, fitted(case, LATE), ()) is None
    assert next_experiment(case, fitted(case), ()) is None
