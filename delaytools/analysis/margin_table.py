"""The margins of one curve for many extra delays, as columns: one entry per delay."""

from dataclasses import dataclass
from typing import final

import numpy as np

from delaytools.analysis.crossings import GainCrossings, PhaseCrossings, gain_crossings, phase_crossings
from delaytools.analysis.curve import FLOOR, Curve, RealArray
from delaytools.analysis.nearest_point import modulus_and_disk_margins

__all__ = ["MarginTable", "margin_table", "wrapped"]


@final
@dataclass(frozen=True, eq=False)
class MarginTable:
    """Columns over the delays τ (n,) in s; inf where there is no such margin, with nan as its frequency.

    They hold where the closed loop is stable. phases (n, number of gain crossings): π + arg L - ωτ in (-π, π].
    """

    delays: RealArray
    gain_margin: RealArray
    gain_margin_frequency: RealArray
    phase_margin: RealArray
    phase_margin_frequency: RealArray
    delay_margin: RealArray
    modulus_margin: RealArray
    disk_margin: RealArray
    gains: GainCrossings
    phases: RealArray
    listed: PhaseCrossings


def wrapped(angle: RealArray) -> RealArray:
    """The angle in (-π, π]."""
    return np.pi - np.mod(np.pi - angle, 2 * np.pi)


def margin_table(curve: Curve, delays: RealArray) -> MarginTable:
    """Margins of L(jω) e^{-jωτ} for each τ of `delays` (n,) in s >= 0; gain crossings are shared by all.

    Gain margin: 1/|L| nearest 1 in log over the phase crossings, ω = 0 and ω → ∞ included. Phase margin: the
    smallest |π + arg L| over the gain crossings. Delay margin: the smallest (π + arg L mod 2π)/ω there; 0 where
    limsup |L| >= 1. (A stable closed loop loses stability at the first value that puts a root on the axis.)
    """
    gains, phases = gain_crossings(curve), phase_crossings(curve, delays)
    ends = _end_crossings(curve, delays)
    joined = PhaseCrossings(
        *(np.concatenate([getattr(part, name) for part in (phases, ends)]) for name in _PARTS)
    )
    margin, frequency = _nearest_gain(joined, len(delays))
    turned = wrapped(np.angle(-gains.value)[None, :] - delays[:, None] * gains.omega[None, :])
    angle, at = _nearest_angle(turned, gains.omega)
    shown = joined.gain >= FLOOR
    listed = PhaseCrossings(*(getattr(joined, name)[shown] for name in _PARTS))
    return MarginTable(
        delays, margin, frequency, angle, at, _delay_margins(curve, turned, gains.omega),
        *modulus_and_disk_margins(curve, delays), gains, turned, listed,
    )  # fmt: skip


_PARTS = ("index", "omega", "gain")


def _end_crossings(curve: Curve, delays: RealArray) -> PhaseCrossings:
    """The crossings at ω = 0, at ω → ∞ and, for a sampled response, at ω = π/T."""
    features, every = curve.features, np.arange(len(delays))
    found: list[tuple[np.ndarray, float, np.ndarray]] = []
    if features.at_zero < 0:
        found.append((every, 0.0, np.full(len(delays), -features.at_zero)))
    still = (delays == 0) & np.isfinite(features.at_infinity)
    far = np.where(
        still, np.maximum(-np.nan_to_num(features.at_infinity), 0.0), np.nan_to_num(features.ceiling)
    )
    found.append((every[far > 0], np.inf, far[far > 0]))
    if curve.top is not None and curve.value[-1].real < 0:
        found.append((every, curve.top, np.full(len(delays), -float(curve.value[-1].real))))
    index, gain = (np.concatenate([entry[i] for entry in found]) for i in (0, 2))
    return PhaseCrossings(index, np.concatenate([np.full(len(e[0]), e[1]) for e in found]), gain)


def _nearest_gain(found: PhaseCrossings, n: int) -> tuple[RealArray, RealArray]:
    """The factor 1/|L| nearest 1 in log for each delay, and its frequency."""
    margin, frequency = np.full(n, np.inf), np.full(n, np.nan)
    distance = np.abs(np.log(found.gain))
    order = np.lexsort((-distance, found.index))  # the nearest is written last
    margin[found.index[order]] = 1.0 / found.gain[order]
    frequency[found.index[order]] = found.omega[order]
    return margin, frequency


def _nearest_angle(turned: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
    if not omega.size:
        return np.full(len(turned), np.inf), np.full(len(turned), np.nan)
    best = np.argmin(np.abs(turned), axis=1)
    return np.take_along_axis(turned, best[:, None], axis=1)[:, 0], omega[best]


def _delay_margins(curve: Curve, turned: RealArray, omega: RealArray) -> RealArray:
    if curve.features.ceiling >= 1:
        return np.zeros(len(turned))
    if not omega.size:
        return np.full(len(turned), np.inf)
    return (np.mod(turned, 2 * np.pi) / omega).min(axis=1)
