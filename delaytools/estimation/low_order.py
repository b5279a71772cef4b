"""Low-order equivalent system: the second-order lag, with or without a delay, that stands for what was measured."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.estimation.least_squares import Estimate
from delaytools.estimation.low_order_frequency import fit_response
from delaytools.estimation.low_order_time import fit_rows
from delaytools.signals.record import Record
from delaytools.signals.response import Response
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["LowOrderFit", "against_delay", "fit"]


@final
@dataclass(frozen=True, eq=False)
class LowOrderFit:
    """b₀ e^{-sτ} / (s² + 2ζω s + ω²), b₀ = gain ω².

    numerator (b₀,), denominator (1, 2ζω, ω²). natural_frequency ω rad/s, damping ζ, delay τ s, gain: output's unit per
    input's. std by name, of the coefficients too (`denominator[1]`). low_frequency_delay = 2ζ/ω s, that of the lag
    alone. cost: in time Σ r²/Σ (y - ȳ)²; in frequency J = (20/n) Σ [ΔdB² + 0.01745 Δphase_deg²]. estimate: limits and
    correlations. words: what it is, and what it is not.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    natural_frequency: float
    damping: float
    delay: float
    gain: float
    std: Mapping[str, float]
    low_frequency_delay: float
    cost: float
    estimate: Estimate
    words: str

    def response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """G(jω) at ω (n,) rad/s."""
        s = 1j * np.asarray(omega, dtype=float)
        return np.asarray(
            self.numerator[0] * np.exp(-s * self.delay) / np.polyval(self.denominator, s), dtype=complex
        )


def fit(source: Record | Response, input: str = "", output: str = "", *, delay: bool = False) -> LowOrderFit:
    """The low-order equivalent system between two signals of a record, or of a frequency response.

    From a record: output error in time, with the exact answer to the input as the record interpolates it (held
    signals held, others linear) and the state at the first row fitted too; before it the input has its first value.
    From a response: the LOES cost of MIL-STD-1797A over log-spaced frequencies. `delay`: fit an equivalent delay too.
    Raises DelaytoolsError for an unknown signal, an input that never moves, or too few rows.
    """
    if isinstance(source, Response):
        found, cost = fit_response(source, delay=delay)
    else:
        for name in (input, output):
            if name not in source:
                raise DelaytoolsError("no such signal in the record", found=repr(name), known=source.names)
        found, cost = fit_rows(source, input, output, delay=delay)
    return _record(found, cost)


def _record(found: Estimate, cost: float) -> LowOrderFit:
    w, zeta, gain, tau = (found[name].value for name in ("natural_frequency", "damping", "gain", "delay"))
    return LowOrderFit(
        numerator=(gain * w**2,), denominator=(1.0, 2 * zeta * w, w**2), natural_frequency=w, damping=zeta,
        delay=tau, gain=gain, std=_stds(found, (w, zeta, gain)), low_frequency_delay=2 * zeta / w, cost=cost,
        estimate=found, words=_words(w, zeta, gain, tau),
    )  # fmt: skip


def _stds(found: Estimate, values: tuple[float, float, float]) -> dict[str, float]:
    """Of the parameters, and to first order of the coefficients made of them."""
    w, zeta, gain = values
    places = [[p.path for p in found.parameters].index(name) for name in ("natural_frequency", "damping", "gain")]
    std = np.array([found.parameters[i].std for i in places])
    covariance = found.correlation[np.ix_(places, places)] * np.outer(std, std)
    slopes = {
        "numerator[0]": np.array([2 * gain * w, 0.0, w**2]),
        "denominator[1]": np.array([2 * zeta, 2 * w, 0.0]),
        "denominator[2]": np.array([2 * w, 0.0, 0.0]),
    }
    made = {name: math.sqrt(abs(float(slope @ covariance @ slope))) for name, slope in slopes.items()}
    named = {name: found.std[name] for name in ("natural_frequency", "damping", "gain", "delay")}
    return named | made


def _words(w: float, zeta: float, gain: float, tau: float) -> str:
    """What was found, so that a resonance is not taken for a delay."""
    stability = "stable" if zeta > 0 else "not stable"
    lag = 2 * zeta / w
    text = f"second order at {w / (2 * math.pi):.4g} Hz, damping {zeta:.3g}, gain {gain:.4g}, {stability}"
    text += f"; its lag delays slow signals by 2ζ/ω = {1e3 * lag:.3g} ms"
    if tau > 0:
        text += f", with the equivalent delay of {1e3 * tau:.3g} ms {1e3 * (lag + tau):.3g} ms in all"
    if zeta >= math.sqrt(0.5):
        return text
    peak = math.inf if zeta <= 0 else 1 / (2 * zeta * math.sqrt(1 - zeta**2))
    half = math.degrees(math.atan2(zeta, 0.75))
    quarter = math.pi / (2 * w)
    return (
        f"{text}; the lag is a resonance with peak {peak:.3g}, not a delay: a delay as late as it is at resonance "
        f"({1e3 * quarter:.3g} ms, 90 deg) turns half that frequency by 45 deg, this by {half:.2g} deg"
    )


def against_delay(found: LowOrderFit, seconds: float, frequency: float) -> str:
    """How far the fit is from a pure delay of `seconds` s, in words; phases at `frequency` Hz.

    For 14050/(s² + 17.86 s + 14050) and 15 ms at 9 Hz (Rao 2023, eq. 3.8): 1.27 ms, 5.3 deg where 48.6 deg.
    """
    w = 2 * math.pi * frequency
    r = w / found.natural_frequency
    own = math.degrees(math.atan2(2 * found.damping * r, 1 - r**2) + w * found.delay)
    whole = found.low_frequency_delay + found.delay
    return (
        f"not a {1e3 * seconds:.4g} ms delay: its low-frequency delay is {1e3 * whole:.3g} ms, "
        f"{seconds / whole:.3g} times less; at {frequency:.4g} Hz it is {own:.3g} deg late, "
        f"a {1e3 * seconds:.4g} ms delay {360 * frequency * seconds:.3g} deg"
        if seconds > 1.2 * whole
        else f"its low-frequency delay is {1e3 * whole:.3g} ms, against {1e3 * seconds:.4g} ms; at {frequency:.4g} Hz "
        f"it is {own:.3g} deg late, a delay of {1e3 * seconds:.4g} ms {360 * frequency * seconds:.3g} deg"
    )
