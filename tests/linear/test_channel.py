"""The transport and the hold, and their derivatives, also near removable points and far left."""

import mpmath
import numpy as np
import pytest

from delaytools.linear.channel import Delay, Hold
from delaytools.signals.trouble import AnalysisError

POINTS = [
    0.0,
    1e-12,
    1e-6 + 1e-7j,
    1e-3j,
    0.5 - 0.2j,
    0.99,
    1.01,
    20j * np.pi,
    20j * np.pi + 1e-8,
    -3 + 2j,
    40 - 7j,
]


def exact(channel, s, order):
    mpmath.mp.dps = 60
    span = mpmath.mpf(channel.span)

    def function(z):
        if isinstance(channel, Delay):
            return mpmath.exp(-z * span)
        return mpmath.mpf(1) if z == 0 else (1 - mpmath.exp(-z * span)) / (z * span)

    point = mpmath.mpc(s) + (mpmath.mpf(10) ** -30 if s == 0 else 0)
    step = mpmath.mpf(10) ** -20
    if order == 0:
        return complex(function(point))
    return complex((function(point + step) - function(point - step)) / (2 * step))


@pytest.mark.parametrize("channel", [Delay(0.1), Hold(0.1), Hold(2.5)])
@pytest.mark.parametrize("s", POINTS)
def test_value_and_derivative(channel, s):
    value, slope = exact(channel, s, 0), exact(channel, s, 1)
    one_rounding_of_the_argument = 2.3e-16 * abs(s * slope)  # all that is left where the value is near zero
    assert abs(channel.value(s) - value) <= 4e-15 * abs(value) + one_rounding_of_the_argument
    assert abs(channel.span * channel.kappa_derivative(s * channel.span) - slope) <= 2e-14 * abs(slope)


@pytest.mark.parametrize("channel", [Delay(0.1), Hold(0.1)])
def test_scaled_forms(channel):
    s = np.array([-3 + 2j, -0.5 - 10j, -20.0])
    factor = np.exp(s * channel.span)
    x = s * channel.span
    assert np.allclose(channel.kappa(x, scaled=True), factor * channel.value(s), rtol=1e-13)
    slope = factor * (channel.kappa_derivative(x) + channel.value(s))
    assert np.allclose(channel.kappa_derivative(x, scaled=True), slope, rtol=1e-12, atol=1e-14)
    assert np.all(np.isfinite(channel.kappa(np.array([-1e5 + 3j]), scaled=True)))
    assert channel.with_span(0.3).span == 0.3 and channel.span == 0.1


def test_shapes_are_kept():
    assert Hold(1.0).value(np.zeros((2, 3))).shape == (2, 3)
    assert np.all(Hold(1.0).value(np.zeros((2, 3))) == 1.0)


@pytest.mark.parametrize(
    "wrong", [lambda: Delay(-1.0), lambda: Delay(np.nan), lambda: Hold(0.0), lambda: Hold(np.inf)]
)
def test_impossible_spans(wrong):
    with pytest.raises(AnalysisError):
        wrong()
