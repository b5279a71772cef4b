"""How much a delay may vary, at any rate, before stability is no longer certain."""

from dataclasses import dataclass
from typing import final

import numpy as np

from delaytools.analysis.bracketing import refined_minima
from delaytools.analysis.curve import ComplexArray, RealArray
from delaytools.analysis.margins import curve_of
from delaytools.linear.delay_system import DelaySystem

__all__ = ["JitterMargin", "jitter_margin"]

_FARTHER = np.geomspace(1.0, 1e4, 200)  # times the last frequency of the curve: what rolls off by one order has a limit


@final
@dataclass(frozen=True)
class JitterMargin:
    """margin: s; frequency: rad/s at which it is decided (inf: beyond all)."""

    margin: float
    frequency: float


def jitter_margin(L: DelaySystem) -> JitterMargin:
    """The extra delay δ(t) in [0, margin] in series with L that may vary in any way while the loop stays stable.

    margin = 1 / sup_ω ω |L/(1 + L)| (Kao & Lincoln, Automatica 40 (2004) 1429, theorem 1; small gain of
    v(t) - v(t - δ(t)) = ∫ v'): certain below, not lost at once above. It says nothing where the loop closed around L is
    not stable; 0 where L passes something on at all frequencies.
    """
    curve = curve_of(L)

    def left(omega: RealArray, value: ComplexArray) -> RealArray:  # 1 / (ω |T|)²
        with np.errstate(all="ignore"):
            return np.nan_to_num(np.abs((1 + value) / (omega * value)) ** 2, nan=np.inf)

    coarse = left(curve.omega, curve.value)
    dips = np.flatnonzero((coarse[1:-1] <= coarse[:-2]) & (coarse[1:-1] <= coarse[2:])) + 1
    at, least = refined_minima(
        lambda x, _: left(x, curve.response(x)), curve.omega[dips - 1], curve.omega[dips], curve.omega[dips + 1]
    )
    far = curve.omega[-1] * _FARTHER
    beyond = left(far, curve.response(far))
    found = [*zip(least.tolist(), at.tolist(), strict=True), (float(coarse[0]), float(curve.omega[0]))]
    if beyond.min() < min(found)[0]:
        passes_all = curve.features.ceiling > 0
        found = [(0.0 if passes_all else float(beyond.min()), np.inf)]
    square, omega = min(found)
    return JitterMargin(float(np.sqrt(square)), float(omega))
