"""The second-order lag that stands for a frequency response, by the cost of low-order equivalent systems."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from delaytools.estimation.least_squares import Estimate, estimate
from delaytools.signals.parameter import Parameter
from delaytools.signals.response import Response
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["fit_response", "loes_residual"]

RealArray = NDArray[np.float64]
_PHASE = 0.01745  # weight of a squared degree against a squared decibel
_REFINED = 3


def fit_response(response: Response, *, delay: bool) -> tuple[Estimate, float]:
    """The estimate of (natural_frequency, damping, gain, delay) and the cost J; MIL-STD-1797A, low-order equivalent.

    J = (20/n) Σ [Δdb² + 0.01745 Δphase_deg²] over n log-spaced frequencies; a response given otherwise is
    interpolated, log gain and phase over log ω. Raises DelaytoolsError for fewer than 5 points or ω <= 0.
    """
    omega, value = _log_spaced(response)

    def residual(x: RealArray) -> RealArray:
        return loes_residual(_model(omega, x), value)

    found = [estimate(residual, start) for start in _starts(omega, value, delay)]
    best = min(found, key=lambda item: item.cost)
    return best, 2 * best.cost


def loes_residual(model: NDArray[np.complex128], measured: NDArray[np.complex128]) -> RealArray:
    """(2n,): the decibels, then the weighted degrees, so that the sum of squares is J; phase differences in ±180."""
    ratio = model / measured
    decibels, degrees = 20 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
    weight = np.sqrt(20 / len(measured))
    return np.asarray(weight * np.concatenate([decibels, np.sqrt(_PHASE) * degrees]))


def _log_spaced(response: Response) -> tuple[RealArray, NDArray[np.complex128]]:
    omega, value = np.asarray(response.frequency, dtype=float), np.asarray(response.value, dtype=complex)
    if len(omega) < 5 or np.any(omega <= 0) or np.any(np.diff(omega) <= 0) or np.any(np.abs(value) == 0):
        raise DelaytoolsError(
            "a fit needs at least 5 rising frequencies above 0 and gains above 0", found=f"{len(omega)} points"
        )
    steps = np.diff(np.log(omega))
    if np.max(steps) < 1.05 * np.min(steps):
        return omega, value
    even = np.geomspace(omega[0], omega[-1], int(np.clip(len(omega), 20, 200)))
    log_gain = np.interp(np.log(even), np.log(omega), np.log(response.gain))
    phase = np.interp(np.log(even), np.log(omega), response.phase)
    return even, np.exp(log_gain + 1j * phase)


def _model(omega: RealArray, x: RealArray) -> NDArray[np.complex128]:
    w, zeta, gain, delay = x
    s = 1j * omega
    return np.asarray(gain * w**2 * np.exp(-s * delay) / (s**2 + 2 * zeta * w * s + w**2), dtype=complex)


def _starts(omega: RealArray, value: NDArray[np.complex128], delay: bool) -> list[list[Parameter]]:
    low, high = omega[0] / 10, omega[-1] * 10
    most = 4 * np.pi / omega[0] if delay else 0.0
    delays = [0.0, *np.geomspace(0.05 / omega[-1], most, 24)] if delay else [0.0]
    grid = product(np.geomspace(omega[0] / 2, 2 * omega[-1], 24), (0.05, 0.3, 1.0), delays, (1.0, -1.0))
    ranked = []
    for w, zeta, tau, sign in grid:
        shape = _model(omega, np.array([w, zeta, sign, tau]))
        size = float(np.exp(np.mean(np.log(np.abs(value / shape)))))
        ranked.append((float(np.sum(loes_residual(size * shape, value) ** 2)), (w, zeta, sign * size, tau)))
    ranked.sort(key=lambda item: item[0])
    return [_parameters(point, (low, high), most, delay) for _, point in ranked[:_REFINED]]


def _parameters(
    point: tuple[float, float, float, float], ends: tuple[float, float], most: float, delay: bool
) -> list[Parameter]:
    w, zeta, gain, tau = (float(item) for item in point)
    low, high = sorted((1e-6 * gain, 1e6 * gain))
    return [
        Parameter("natural_frequency", w, "rad/s", *ends),
        Parameter("damping", zeta, "", 0.0, 20.0),
        Parameter("gain", gain, "", low, high),
        Parameter("delay", tau, "s", 0.0, most, fixed=not delay),
    ]
