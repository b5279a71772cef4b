"""What is judged of a residual: folds that both tell the values apart, and noise that is as strong everywhere."""

import numpy as np
import pytest

from delaytools.diagnosis.case import Rows
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.heldout import held_out
from delaytools.diagnosis.noise import autoregression
from delaytools.diagnosis.unevenness import loudest
from delaytools.signals.parameter import Parameter

STEP = 1e-3
TIME = np.arange(10_000) * STEP
NOISE = np.random.default_rng(3).standard_normal(len(TIME))
SLOW = 5 * np.sin(2 * np.pi * 0.4 * TIME)
NOTHING_SENT = np.zeros(len(TIME))


def test_a_mode_that_rings_once_is_judged_where_it_rings():
    ringing = 30 * np.exp(-20 * TIME)
    slopes = np.stack([ringing * np.sin(390 * TIME), TIME * ringing * np.cos(390 * TIME)], axis=1)
    weights = np.linalg.lstsq(slopes, NOISE, rcond=None)[0]
    left = NOISE - slopes @ weights
    rows = Rows(np.zeros(len(TIME), dtype=int), np.zeros(len(TIME), dtype=int), TIME)
    parameters = tuple(Parameter(f"effects.1000.{name}", 1.0) for name in ("gain", "frequency"))
    fitted = Fitted((), parameters, left, slopes)
    assert held_out(fitted, rows).chi2 < fitted.chi2 + 40


def test_noise_is_as_loud_everywhere():
    assert loudest(NOISE, {"rate": SLOW}, NOTHING_SENT, STEP) is None


def test_what_is_loud_at_some_levels_only_is_no_noise():
    shape = np.where(np.abs(SLOW) < 0.4, 4.0, 1.0)
    left = NOISE * shape / np.sqrt(np.mean(shape**2))
    found = loudest(left, {"rate": SLOW}, NOTHING_SENT, STEP)
    assert found is not None and found.signal == "rate" and not found.is_rate
    assert abs(found.low + found.high) / 2 < 0.8


def test_noise_of_the_inputs_may_be_sent_at_some_levels_only():
    shape = np.where(np.abs(SLOW) < 0.4, 4.0, 1.0)
    shape /= np.sqrt(np.mean(shape**2))
    sent = 0.6 * np.random.default_rng(4).standard_normal(len(TIME)) * shape
    assert loudest(NOISE * shape, {"rate": SLOW}, sent, STEP) is None


def test_a_rest_that_drifts_is_white_behind_its_own_filter():
    drift = np.cumsum(np.cumsum(NOISE)) * 1e-6 + 1e-8 * np.random.default_rng(5).standard_normal(len(NOISE))
    white = autoregression([drift]).apply(drift)
    assert np.sqrt(np.mean(white**2)) == pytest.approx(1.0, abs=1e-9)
    slow = np.abs(np.fft.rfft(white)[:20]) ** 2 / len(white)
    assert slow.mean() < 3.0
