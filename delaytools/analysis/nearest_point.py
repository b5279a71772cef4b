"""How near the curve L(jω) e^{-jωτ} comes to -1, for many delays τ: modulus and disk margins."""

from collections.abc import Callable

import numpy as np

from delaytools.analysis.bracketing import Indices, refined_minima
from delaytools.analysis.curve import ComplexArray, Curve, RealArray

Measure = Callable[[ComplexArray], RealArray]

__all__ = ["modulus_and_disk_margins"]


def modulus_and_disk_margins(curve: Curve, delays: RealArray) -> tuple[RealArray, RealArray]:
    """For each delay τ (s), over all ω with both ends: (min |1 + L e^{-jωτ}|, α); shapes of `delays`.

    modulus margin 1/‖S‖∞; α = 2/‖(1-L)/(1+L)‖∞ = 1/‖S - 1/2‖∞, MATLAB's disk margin with σ = 0.
    """
    size = np.abs(curve.value)
    cosine = np.cos(curve.phase[None, :] - delays[:, None] * curve.omega[None, :])
    modulus = _least(curve, delays, cosine * (2 * size) + (1 + size**2), _distance)
    return modulus, 2.0 * _least(curve, delays, cosine * (2 * size / (1 + size**2)), _ratio)


def _distance(L: ComplexArray) -> RealArray:
    return np.abs(1 + L)


def _ratio(L: ComplexArray) -> RealArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.isfinite(L), np.abs(1 + L) / np.abs(1 - L), 1.0)


def _least(curve: Curve, delays: RealArray, coarse: RealArray, measure: Measure) -> RealArray:
    """The least measure(L) of each delay: all dips of the coarse values near the lowest, refined."""
    dip = (coarse[:, 1:-1] <= coarse[:, :-2]) & (coarse[:, 1:-1] <= coarse[:, 2:])
    dip &= coarse[:, 1:-1] <= coarse.min(axis=1, keepdims=True) + 0.1
    dip &= ~(curve.gap[:-1] | curve.gap[1:])
    index, middle = np.nonzero(dip)
    omega = curve.omega

    def family(x: RealArray, which: Indices) -> RealArray:
        return measure(curve.response(x) * np.exp(-1j * x * delays[index[which]])) ** 2  # smooth at its least

    _, squares = refined_minima(family, omega[middle], omega[middle + 1], omega[middle + 2])
    least = _at_ends(curve, delays, measure)
    np.minimum.at(least, index, np.sqrt(squares))
    return least


def _at_ends(curve: Curve, delays: RealArray, measure: Measure) -> RealArray:
    """The measure at the first and last point of the curve, at ω = 0 and at ω → ∞."""
    ends = curve.value[[0, -1], None] * np.exp(-1j * curve.omega[[0, -1], None] * delays[None, :])
    least = measure(ends).min(axis=0)
    features = curve.features
    if np.isfinite(features.at_zero):
        least = np.minimum(least, measure(np.array(complex(features.at_zero))))
    if not np.isfinite(features.ceiling):
        return least
    still = (delays == 0) & np.isfinite(features.at_infinity)
    far = np.where(still, np.nan_to_num(features.at_infinity), -features.ceiling)
    return np.minimum(least, measure(far.astype(complex)))
