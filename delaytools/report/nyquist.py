"""L(jω) of chosen loops, exact with its delays, as curves to be drawn."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.curve import Curve, Features, traced
from delaytools.analysis.margins import Margins, curve_of
from delaytools.analysis.opened_loop import open_loop
from delaytools.linear.lifted import lift
from delaytools.loop.loop import Loop

__all__ = ["NyquistCurve", "nyquist_curve"]


@final
@dataclass(frozen=True)
class NyquistCurve:
    """omega (n,) rad/s, value (n,) = L(jω); modulus_at: the point of L nearest -1, modulus: its distance."""

    name: str
    flies: bool
    omega: NDArray[np.float64]
    value: NDArray[np.complex128]
    modulus: float
    modulus_at: complex
    stable: bool


def nyquist_curve(
    loop: Loop, at: str, name: str, margins: Margins, *, flies: bool = False, delay_at: str | None = None
) -> NyquistCurve:
    """The curve of the loop opened at `at`, with the margins' delay at `delay_at`, thinned to what can be seen."""
    curve = _curve(loop, at, margins.delay, delay_at)
    nearest = int(np.argmin(np.abs(1 + curve.value)))
    omega, value = _thinned(curve)
    at_nearest = complex(curve.value[nearest])
    modulus = margins.modulus_margin if margins.modulus_margin is not None else abs(1 + at_nearest)
    return NyquistCurve(name, flies, omega, value, modulus, at_nearest, margins.stable)


def _curve(loop: Loop, at: str, extra: float, delay_at: str | None) -> Curve:
    opened = open_loop(loop, at, delay_at)
    if not (opened.opened.samplers and opened.exact_sampling):
        return curve_of(opened.transfer(extra))
    sampled = opened.sampled(extra)
    lifted = lift(sampled.opened, {sampled.reader: sampled.period})
    assert lifted is not None
    poles = lifted.multipliers[np.abs(lifted.multipliers) > 1e-6].astype(complex)
    features = Features(np.log(poles) / sampled.period, (), np.nan, np.nan, np.nan)

    def response(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return -lifted.pulse(omega)[:, 0, 0]

    return traced(response, features, top=np.pi / sampled.period)


def _thinned(curve: Curve) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Enough points for a smooth line within |L| < 10: between traced ones the response is asked again."""
    inside = (np.abs(curve.value) > 0.005) & (np.abs(curve.value) < 30)
    omega = curve.omega[inside] if inside.any() else curve.omega
    omega = np.geomspace(omega[0], omega[-1], 700)
    return omega, curve.response(omega)
