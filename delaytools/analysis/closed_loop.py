"""The closed loop's sensitivity and complementary sensitivity: systems, peaks and bandwidth."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from delaytools.analysis.bracketing import refined_minima, refined_roots
from delaytools.analysis.curve import ComplexArray, Curve, RealArray
from delaytools.analysis.margins import curve_of
from delaytools.analysis.stability import closed_loop_of
from delaytools.linear.delay_system import DelaySystem

__all__ = ["ClosedLoop", "closed_loop", "complementary_sensitivity", "sensitivity"]

MINUS_3_DB = 10.0 ** (-3.0 / 20.0)


@final
@dataclass(frozen=True)
class ClosedLoop:
    """Peaks of |S| = |1/(1+L)| and |T| = |L/(1+L)| with their frequencies (rad/s), and the bandwidth of T.

    A frequency of 0 or inf means that the peak is the limit there. bandwidth: the first ω (rad/s) at which
    |T| falls 3 dB below |T(0)|; None where it never does.
    """

    sensitivity_peak: float
    sensitivity_peak_frequency: float
    complementary_peak: float
    complementary_peak_frequency: float
    bandwidth: float | None


def sensitivity(L: DelaySystem) -> DelaySystem:
    """S = 1/(1 + L), from the reference to the error; AnalysisError where 1 + L(∞) = 0."""
    return 1.0 - closed_loop_of(L)


def complementary_sensitivity(L: DelaySystem) -> DelaySystem:
    """T = L/(1 + L), from the reference to the output; AnalysisError where 1 + L(∞) = 0."""
    return closed_loop_of(L)


def closed_loop(L: DelaySystem) -> ClosedLoop:
    """Peaks and bandwidth of the loop closed around L (one input, one output), refined to rounding.

    They describe the frequency response; whether the loop is stable is said by `margins`.
    """
    curve = curve_of(L)
    frequency_s, least_s = _least(curve, lambda value: np.abs(1 + value))
    frequency_t, least_t = _least(curve, _inverse_complementary)
    return ClosedLoop(1 / least_s, frequency_s, 1 / least_t, frequency_t, _bandwidth(curve))


def _inverse_complementary(value: ComplexArray) -> RealArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(np.abs(1 + 1 / value), nan=np.inf)


def _least(curve: Curve, measure: Callable[[ComplexArray], RealArray]) -> tuple[float, float]:
    """(frequency, value) of the least measure(L) along the curve, its ends at 0 and ∞ included."""
    coarse = measure(curve.value)
    dip = np.flatnonzero((coarse[1:-1] <= coarse[:-2]) & (coarse[1:-1] <= coarse[2:])) + 1
    omega, squares = refined_minima(
        lambda x, _: measure(curve.response(x)) ** 2,
        curve.omega[dip - 1],
        curve.omega[dip],
        curve.omega[dip + 1],
    )
    ends = [(0.0, curve.features.at_zero), (np.inf, curve.features.at_infinity)]
    ends = [(w, float(measure(np.array([complex(value)]))[0])) for w, value in ends if np.isfinite(value)]
    found = [*zip(omega.tolist(), np.sqrt(squares).tolist(), strict=True), *ends, (curve.omega[0], coarse[0])]
    best = min(found, key=lambda pair: pair[1])
    return float(best[0]), float(best[1])


def _bandwidth(curve: Curve) -> float | None:
    at_zero = curve.features.at_zero
    level = abs(at_zero / (1 + at_zero)) if np.isfinite(at_zero) else 1.0
    if level == 0:
        return None

    def above(value: ComplexArray) -> RealArray:
        return np.log(np.abs(value / (1 + value)) / (MINUS_3_DB * level))

    below = np.flatnonzero(above(curve.value) < 0)
    if not below.size or below[0] == 0:
        return None
    place = np.array([below[0]])
    root = refined_roots(lambda x, _: above(curve.response(x)), curve.omega[place - 1], curve.omega[place])
    return float(root[0])
