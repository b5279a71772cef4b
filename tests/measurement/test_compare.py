"""Model against measurement: figures against plain formulas, effects seen where they are, and no false alarm."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from delaytools.cli.answers import plain
from delaytools.cli.measured import comparison_answer
from delaytools.design.build import build
from delaytools.design.edit import with_effect
from delaytools.design.file import read_design
from delaytools.estimation.noise_level import difference_noise
from delaytools.measurement.compare import compare
from delaytools.measurement.log_file import Columns, read_log
from delaytools.measurement.measures import best_shift, figures, fit_percent, theil
from delaytools.measurement.residual_spectra import holm, spectra, windowed
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError
from tests.measurement.bench_logs import BENCH, NOISE, bench_design, bench_log

DELAY = {"type": "delay", "at": "gyro.input", "delay": "7 ms"}
DEAD_BAND = {"type": "dead_band", "at": "actuator.input", "half_width": "0.1 deg"}
DISTURBANCE = {"type": "constant_disturbance", "at": "airframe.output'", "level": 3.0}
HUM = {"type": "periodic_interference", "at": "gyro.output", "amplitude": 0.3, "frequency": "50 Hz"}


def failing(record: Record) -> set[str]:
    return {one.signal for one in compare(bench_design(), [record]).signals if one.verdict == "fails"}


# --- figures against plain formulas ---


def test_fit_and_theil_are_their_formulas() -> None:
    draw = np.random.default_rng(3)
    y = 2.0 + np.cumsum(draw.standard_normal(500))
    m = 0.8 * y + 1.0 + 0.3 * draw.standard_normal(500)
    assert fit_percent(y, m) == pytest.approx(100 * (1 - math.sqrt(sum((y - m) ** 2) / sum((y - np.mean(y)) ** 2))))
    found = theil(y, m)
    square = np.mean((y - m) ** 2)
    r = np.corrcoef(y, m)[0, 1]
    assert found.coefficient == pytest.approx(math.sqrt(square) / (math.sqrt(np.mean(y**2)) + math.sqrt(np.mean(m**2))))
    assert found.bias == pytest.approx((y.mean() - m.mean()) ** 2 / square)
    assert found.variance == pytest.approx((y.std() - m.std()) ** 2 / square)
    assert found.covariance == pytest.approx(2 * (1 - r) * y.std() * m.std() / square)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("planted", [-0.0313, 0.0, 0.00237, 0.015, 0.11])
def test_a_planted_shift_is_found_between_rows(planted: float, held: bool) -> None:
    t = np.arange(4000) * 0.002

    def wave(time: np.ndarray) -> np.ndarray:
        return np.sin(2.1 * time) + 0.4 * np.sin(9.3 * time + 1) + 0.1 * np.cos(23 * time)

    found = best_shift([(t, wave(t - planted), wave(t))], held=held)
    assert found.seconds == pytest.approx(planted, abs=5e-5 if held else 1e-6)
    assert found.error_after is not None and found.error_after < 1e-3


def test_noise_is_found_under_a_moving_signal() -> None:
    draw = np.random.default_rng(5)
    t = np.arange(20000) * 1e-3
    y = 30 * np.sin(12 * t) + 0.02 * draw.standard_normal(len(t))
    assert difference_noise(y) == pytest.approx(0.02, rel=0.03)


def test_spectra_hold_the_mean_square_and_see_what_is_coherent() -> None:
    draw = np.random.default_rng(6)
    u, e = draw.standard_normal((2, 30000))
    assert np.sum(np.mean(np.abs(windowed(e, 512)) ** 2, axis=0)) == pytest.approx(np.mean(e**2), rel=0.03)
    alone = spectra(1e-3, [e], [np.zeros_like(e)], [[u]], 1.0)
    both = spectra(1e-3, [e + 0.5 * u], [np.zeros_like(e)], [[u]], 1.0)
    assert not holm(alone.p_coherence, 1e-3).any()
    assert both.coherence.mean() == pytest.approx(0.2, abs=0.03) and holm(both.p_coherence, 1e-3).mean() > 0.3
    assert alone.error.sum() == pytest.approx(alone.noise.sum(), rel=0.05)


def test_holm_is_stepwise() -> None:
    assert holm(np.array([0.03, 0.001, 0.02, 0.8]), 0.05).tolist() == [False, True, False, False]
    assert holm(np.array([0.02, 0.001, 0.016, 0.8]), 0.06).tolist() == [True, True, True, False]


# --- planted effects ---


@pytest.mark.parametrize("seed", range(1, 5))
def test_the_bench_itself_is_adequate(seed: int) -> None:
    found = compare(bench_design(), [bench_log(seed=seed)])
    assert [one.signal for one in found.signals] == ["command", "fin", "rate", "sensed"]
    assert found.adequate and "explained" in found.where
    for name, size in NOISE.items():
        assert found[name].noise_rms == pytest.approx(size, rel=0.05)
        assert found[name].rms_error == pytest.approx(found[name].explained_rms, rel=0.1)
    assert found["rate"].carried_noise_rms == pytest.approx(found["rate"].rms_error, rel=0.6)


@pytest.mark.parametrize(
    "effect, signal", [(DELAY, "sensed"), (DEAD_BAND, "fin"), (DISTURBANCE, "rate"), (HUM, "sensed")]
)
def test_an_effect_shows_at_its_signal_alone(effect: dict[str, object], signal: str) -> None:
    assert failing(bench_log(effect)) == {signal}


def test_a_planted_delay_is_the_shift() -> None:
    found = compare(bench_design(), [bench_log(DELAY, noise={})])
    assert found["sensed"].overall.shift.seconds == pytest.approx(0.007, abs=2e-5)
    assert "shifted by 7 ms (later than the model)" in found.where and "block gyro" in found.where


def test_a_difference_below_a_quarter_of_the_noise_is_no_failure() -> None:
    small = {"type": "bias", "at": "gyro.output", "level": 0.008}
    found = compare(bench_design(), [bench_log(small)])["sensed"]
    assert found.verdict == "adequate" and found.difference_rms < 0.25 * found.explained_rms


def test_exact_logs_agree_to_rounding() -> None:
    found = compare(bench_design(), [bench_log(noise={})])
    assert found.adequate
    assert all((one.overall.fit_percent or 0) > 99.99 for one in found.signals)


def test_the_band_and_the_time_of_an_error_are_named() -> None:
    hum = compare(bench_design(), [bench_log(HUM)])["sensed"]
    low, high, share, _ = hum.worst_bands[0]
    assert low < 50 < high and share > 0.8
    burst = {"type": "transient_gain", "at": "actuator.input", "factor": 1.6, "start": "4 s", "end": "5 s"}
    fin = compare(bench_design(), [bench_log(burst)])["fin"]
    start, end, share = fin.worst_times[0]
    assert 3.7 < start < 4.3 and 4.7 < end < 5.5 and share > 0.8


def test_shares_add_to_one() -> None:
    strips = compare(bench_design(), [bench_log(DEAD_BAND)])["fin"].strips
    assert strips.time_shares.sum() == pytest.approx(1.0)
    assert strips.band_shares.sum() == pytest.approx(1.0)
    for quantity in ("amplitude", "rate"):
        levels = [one for one in strips.levels if one.quantity == quantity]
        assert sum(one.share for one in levels) == pytest.approx(1.0)
        assert sum(one.share_of_time for one in levels) == pytest.approx(1.0)


# --- several logs, other logs ---


def test_several_logs_each_and_together() -> None:
    good, bad = bench_log(seed=1), bench_log(DEAD_BAND, seed=2)
    found = compare(bench_design(), [good, bad])["fin"]
    assert found.verdict == "fails" and len(found.logs) == 2
    one, two = (log.rms_error for log in found.logs)
    assert one is not None and two is not None and one < 0.02 < two
    assert found.rms_error == pytest.approx(math.sqrt((one**2 + two**2) / 2))


def test_a_comparison_of_a_loop_is_that_of_its_design() -> None:
    record = bench_log(DELAY)
    one, two = compare(bench_design(), [record]), compare(build(bench_design()), [record])
    assert [s.rms_error for s in one.signals] == [s.rms_error for s in two.signals]


def test_the_closed_loop_is_run_from_outside() -> None:
    record = bench_log(noise={})
    run = compare(bench_design(), [record]).closed_loop[0]
    assert run.why == "" and all(fit is not None and fit > 99.9 for _, fit in run.figures.values())
    deaf = record.only(["command", "fin", "rate", "sensed"])
    assert "demand" in compare(bench_design(), [deaf]).closed_loop[0].why


def test_a_signal_whose_input_was_not_logged_is_left_out_and_said() -> None:
    deaf = bench_log().only(["command", "fin", "rate", "sensed"])
    found = compare(bench_design(), [deaf])
    assert "demand" in found.not_compared["command"] and found["fin"].verdict == "adequate"
    with pytest.raises(AnalysisError, match="no log"):
        compare(bench_design(), [])


def test_a_dead_signal_gives_no_nan() -> None:
    record = bench_log()
    still = Record(record.time, {**record.columns, "sensed": np.zeros(len(record))}, record.units, record.held)
    found = compare(bench_design(), [still])
    assert found["sensed"].verdict == "fails" and found["sensed"].overall.fit_percent is None
    text = json.dumps(plain(comparison_answer(found)), allow_nan=False)
    entry = next(one for one in json.loads(text)["signals"] if one["signal"] == "sensed")
    assert entry["fit_percent"] is None and entry["fit_percent_why"] == "the measured signal does not move"
    nothing = Record(record.time, dict.fromkeys(record.names, np.zeros(len(record))), record.units, record.held)
    quiet = compare(bench_design(), [nothing])
    assert quiet.adequate and quiet["fin"].overall.shift.seconds is None
    json.dumps(plain(comparison_answer(quiet)), allow_nan=False)


def test_rows_need_not_be_even() -> None:
    record = bench_log()
    keep = np.ones(len(record), dtype=bool)
    keep[1000:1030] = False
    found = compare(bench_design(), [record.rows(keep)])
    assert all(one.rms_error is not None and math.isfinite(one.rms_error) for one in found.signals)


def test_a_model_that_runs_away_fails_in_words() -> None:
    text = BENCH.replace('type = "first_order"\ninput = "fin"', 'type = "transfer_function"\ninput = "fin"')
    text = text.replace('time_constant = "0.4 s"\ngain = 20.0', "numerator = [50.0]\ndenominator = [1.0, -200.0]")
    found = compare(bench_design(text), [bench_log()])["rate"]
    assert found.verdict == "fails"
    json.dumps(plain(comparison_answer(compare(bench_design(text), [bench_log()]))), allow_nan=False)


def test_tolerances_are_said_and_not_fitted() -> None:
    text = BENCH + '\n[tolerance]\n"actuator.natural_frequency" = "10 %"\n'
    off = bench_log(text=BENCH.replace("90 rad/s", "95 rad/s"))
    found = compare(bench_design(text), [off])
    assert found["fin"].verdict == "fails" and "nothing was fitted" in found.notes[0]
    assert "actuator.natural_frequency may be off by tolerance" in found.where


def test_figures_of_a_configuration() -> None:
    text = BENCH + '\n[configurations.late]\neffects = [ { type = "delay", at = "gyro.input", delay = "7 ms" } ]\n'
    record = bench_log(DELAY)
    assert compare(bench_design(text), [record], configuration="late").adequate
    assert not compare(bench_design(text), [record]).adequate


def test_the_improved_design_is_adequate() -> None:
    record = bench_log(DEAD_BAND)
    assert compare(with_effect(bench_design(), DEAD_BAND), [record]).adequate


def test_figures_of_equal_signals() -> None:
    t = np.arange(100) * 0.01
    found = figures("x", [(t, np.sin(t), np.sin(t))])
    assert found.fit_percent == 100 and found.theil.bias is None and "no error" in found.why["theil"]
    assert dataclasses.is_dataclass(found)


# --- practice benches ---

PRACTICE = Path(__file__).parents[3] / "shared" / "practice"
FAILS = {
    "p01": {"table_rate"}, "p02": {"fin_position"}, "p03": set(), "p04": {"fin_position"}, "p05": {"fin_position"},
    "p06": {"roll_rate"}, "p07": {"fin_position", "table_rate"}, "p08": {"sensed_rate"}, "p09": {"position", "rate"},
    "p10": {"fin_position", "table_rate"}, "p11": set(), "p12": {"fin_position"}, "p13": {"fin_position"},
    "p14": {"fin_position"}, "p15": {"fin_position"}, "p16": {"sensed_rate"},
}  # fmt: skip


@pytest.mark.practice
@pytest.mark.skipif(not PRACTICE.is_dir(), reason="the practice benches are not part of the project")
@pytest.mark.parametrize("case", sorted(FAILS))
def test_practice_benches_fail_where_they_should(case: str) -> None:
    design = read_design(PRACTICE / case / "bench.toml")
    record = read_log(PRACTICE / case / "run.csv", Columns(units=dict(build(design).units)))
    found = {one.signal for one in compare(design, [record]).signals if one.verdict == "fails"}
    assert found == FAILS[case]
