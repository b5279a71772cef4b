"""How much a delay may vary, at any rate or a bounded one, before stability is no longer certain."""

from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.optimize import minimize_scalar

from delaytools.analysis.bracketing import refined_minima
from delaytools.analysis.curve import ComplexArray, Curve, RealArray
from delaytools.analysis.margins import curve_of
from delaytools.linear.delay_system import DelaySystem
from delaytools.signals.trouble import AnalysisError

__all__ = ["JitterMargin", "jitter_margin"]

_FARTHER = np.geomspace(1.0, 1e4, 200)  # times the last frequency of the curve: what rolls off by one order has a limit


@final
@dataclass(frozen=True)
class JitterMargin:
    """margin: s; frequency: rad/s at which it is decided (inf: beyond all)."""

    margin: float
    frequency: float


def jitter_margin(L: DelaySystem, rate: float = np.inf) -> JitterMargin:
    """The extra delay δ(t) in [0, margin] in series with L that may vary while the loop stays stable, |δ'| <= rate.

    margin² = max over b >= 0 of inf over ω of (|1 + L|² + b (1 - |L|²/(1 - rate)))/(ω |L|)²; b = 0 where the rate is 1
    or more, and known of any delay: 1/sup ω |L/(1 + L)| (Kao & Lincoln, Automatica 40 (2004) 1429, theorem 1). From
    ∫|w|² <= margin² ∫|v'|² for w(t) = v(t - δ(t)) - v(t), and ∫|v + w|² <= ∫|v|²/(1 - rate) (Kao & Rantzer, Automatica
    43 (2007) 959). Certain below, not lost at once above. It says nothing where the loop closed around L is not stable;
    0 where L passes something on at all frequencies. Raises AnalysisError for a negative rate.
    """
    if not rate >= 0:
        raise AnalysisError("a rate of delay is not negative", found=f"{rate}")
    curve = curve_of(L)
    if rate >= 1:
        return _allowed(curve, 0.0, 1.0)

    def worse(b: float) -> float:
        return -_allowed(curve, b, 1 - rate).margin

    best = minimize_scalar(worse, bounds=(0.0, 1 - rate), method="bounded", options={"xatol": 1e-9})
    found = [_allowed(curve, b, 1 - rate) for b in (0.0, float(best.x), 1 - rate)]
    return max(found, key=lambda one: one.margin)


def _allowed(curve: Curve, b: float, slowed: float) -> JitterMargin:
    """The margin with one weight b of the second inequality; slowed: 1 - rate."""

    def left(omega: RealArray, value: ComplexArray) -> RealArray:
        with np.errstate(all="ignore"):
            above = np.abs(1 + value) ** 2 + b * (1 - np.abs(value) ** 2 / slowed)
            return np.nan_to_num(above / np.abs(omega * value) ** 2, nan=np.inf)

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
    return JitterMargin(float(np.sqrt(max(square, 0.0))), float(omega))
