"""Where the curve L(jω) crosses the unit circle and, for any extra delay, the negative real axis."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.bracketing import Indices, refined_minima, refined_roots
from delaytools.analysis.curve import FLOOR, ComplexArray, Curve, RealArray

__all__ = ["GainCrossings", "PhaseCrossings", "gain_crossings", "phase_crossings"]

_NEAR_TOUCH = 0.1  # an extremum of log |L| this near 0 is followed to its top
_NEAR_TURN = 0.03  # and one of the phase this near the negative real axis, in turns
_SEVERAL = 6  # crossings looked for within one segment at most
_TOUCH = 1e-9  # |log |L|| and turns below which an extremum counts as a touch


@final
@dataclass(frozen=True, eq=False)
class GainCrossings:
    """|L(jω)| = 1: `omega` (n,) in rad/s, `value` L there; `falling` +1 where |L| falls, -1 rises, 0 touches."""

    omega: RealArray
    value: ComplexArray
    falling: NDArray[np.int_]


@final
@dataclass(frozen=True, eq=False)
class PhaseCrossings:
    """L(jω) e^{-jωτ} < 0: `index` of τ in the list of delays, `omega` in rad/s and `gain` |L|, all (n,)."""

    index: Indices
    omega: RealArray
    gain: RealArray


def gain_crossings(curve: Curve) -> GainCrossings:
    """All ω of the curve with |L(jω)| = 1, touches included, to rounding."""
    omega, level = (
        curve.omega,
        np.log(np.maximum(np.abs(curve.value), 1e-300)),
    )  # a hold has zeros on the axis

    def family(x: RealArray, _: Indices) -> RealArray:
        return np.log(np.abs(curve.response(x)))

    tops, heights = _level_extrema(curve, level)
    omega, level = np.concatenate([omega, tops]), np.concatenate([level, heights])
    order = np.argsort(omega, kind="stable")
    omega, level = omega[order], level[order]
    gap = _gap_between(curve, omega)
    sign = np.where(level >= 0, 1, -1)
    start = np.flatnonzero((sign[:-1] != sign[1:]) & ~gap)
    roots = refined_roots(family, omega[start], omega[start + 1])
    touch = tops[np.abs(heights) <= _TOUCH]
    touch = touch[[not np.any(np.abs(roots - t) <= 1e-4 * t) for t in touch]] if touch.size else touch
    found = np.concatenate([roots, touch])
    falling = np.concatenate([sign[start], np.zeros(len(touch), dtype=int)])
    order = np.argsort(found)
    return GainCrossings(found[order], curve.response(found[order]), falling[order])


def _level_extrema(curve: Curve, level: RealArray) -> tuple[RealArray, RealArray]:
    """Extrema of log |L| near 0 between the points of the curve, refined."""
    middle = np.flatnonzero((level[1:-1] - level[:-2]) * (level[2:] - level[1:-1]) <= 0) + 1
    middle = middle[(np.abs(level[middle]) < _NEAR_TOUCH) & ~curve.gap[middle - 1] & ~curve.gap[middle]]
    sign = np.where(level[middle] >= level[middle - 1], -1.0, 1.0)

    def family(x: RealArray, which: Indices) -> RealArray:
        return sign[which] * np.log(np.abs(curve.response(x)))

    tops, heights = refined_minima(
        family, curve.omega[middle - 1], curve.omega[middle], curve.omega[middle + 1]
    )
    return tops, sign * heights


def _gap_between(curve: Curve, omega: RealArray) -> NDArray[np.bool_]:
    """The gaps of the curve carried over to a denser list of its frequencies."""
    return curve.gap[
        np.clip(np.searchsorted(curve.omega, omega[:-1], side="right") - 1, 0, len(curve.gap) - 1)
    ]


def phase_crossings(curve: Curve, delays: RealArray) -> PhaseCrossings:
    """All ω > 0 of the curve where L(jω) e^{-jωτ} is real and negative, for every τ of `delays` (s).

    They are the level sets of τ_k(ω) = (arg L(jω) + π + 2πk)/ω, one curve per k: with the phase unwrapped
    once, h(ω) = (arg L + π - ωτ)/2π passes a whole number k at each crossing. Complete where |L| >= 0.01;
    below, at least the first crossing of each segment of the curve.
    """
    turns = (curve.phase[None, :] + np.pi - delays[:, None] * curve.omega[None, :]) / (2 * np.pi)
    whole = np.floor(turns)
    index, start, number = _passed(curve, whole)
    roots = refined_roots(
        _turning(curve, delays, index, start, number), curve.omega[start], curve.omega[start + 1]
    )
    more_index, more = _turned_back(curve, delays, turns, whole)
    index, omega = np.concatenate([index, more_index]), np.concatenate([roots, more])
    value = curve.response(omega)
    shifted = value * np.exp(-1j * omega * delays[index])
    real = (shifted.real < 0) & (np.abs(shifted.imag) <= 1e-6 * np.abs(shifted))
    if curve.top is not None:
        real &= omega < curve.top * (1 - 1e-9)  # the end itself is judged by its sign
    order = np.lexsort((omega, index))
    order = order[real[order]]
    return PhaseCrossings(index[order], omega[order], np.abs(value)[order])


def _passed(curve: Curve, whole: RealArray) -> tuple[Indices, Indices, RealArray]:
    """(delay, segment, whole number passed) of every crossing seen at the points of the curve."""
    steps = np.diff(whole, axis=1)
    steps[:, curve.gap] = 0
    index, start = np.nonzero(steps)
    kept = _worth_following(curve, index, start)
    index, start = index[kept], start[kept]
    step, first = steps[index, start], whole[index, start]
    count = np.where(curve.size[start] >= FLOOR, np.minimum(np.abs(step).astype(int), _SEVERAL), 1)
    offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)  # 0 .. n-1 for each segment
    step, first = np.repeat(step, count), np.repeat(first, count)
    number = np.where(step > 0, first + 1 + offset, first - offset)
    return np.repeat(index, count), np.repeat(start, count), number


def _worth_following(curve: Curve, index: Indices, start: Indices) -> Indices:
    """All crossings where |L| >= 0.01, and for each delay the three of largest |L| below."""
    size = curve.size[start]
    below = np.flatnonzero(size < FLOOR)
    below = below[np.lexsort((-size[below], index[below]))]
    rank = np.arange(below.size) - np.searchsorted(index[below], index[below])
    return np.sort(np.concatenate([np.flatnonzero(size >= FLOOR), below[rank < 3]]))


def _turning(
    curve: Curve, delays: RealArray, index: Indices, start: Indices, number: RealArray
) -> Callable[[RealArray, Indices], RealArray]:
    """h(ω) - k of each crossing, in rad; the phase is followed from the start of its own segment."""
    base = curve.phase[start] + np.pi - 2 * np.pi * number
    value, delay = curve.value[start], delays[index]

    def family(x: RealArray, which: Indices) -> RealArray:
        return base[which] + np.angle(curve.response(x) / value[which]) - x * delay[which]

    return family


def _turned_back(
    curve: Curve, delays: RealArray, turns: RealArray, whole: RealArray
) -> tuple[Indices, RealArray]:
    """Pairs of crossings between two points of the curve, where the phase turns back just past the axis."""
    rising = np.diff(turns, axis=1) > 0
    index, middle = np.nonzero(rising[:, :-1] != rising[:, 1:])
    middle = middle + 1
    inside = turns[index, middle] - whole[index, middle]
    top = rising[index, middle - 1]
    near = np.where(top, 1 - inside, inside) < _NEAR_TURN
    near &= (np.abs(curve.value[middle]) >= 1e-3 * FLOOR) & ~curve.gap[middle - 1] & ~curve.gap[middle]
    index, middle, top = index[near], middle[near], top[near]
    number = np.where(top, whole[index, middle] + 1, whole[index, middle])
    family = _turning(curve, delays, index, middle, number)
    sign = np.where(top, -1.0, 1.0)
    left, right = curve.omega[middle - 1], curve.omega[middle + 1]
    peak, height = refined_minima(
        lambda x, which: sign[which] * family(x, which), left, curve.omega[middle], right
    )
    beyond, touch = height < -_TOUCH, np.abs(height) <= _TOUCH
    family = _turning(curve, delays, index[beyond], middle[beyond], number[beyond])
    before = refined_roots(family, left[beyond], peak[beyond])
    after = refined_roots(family, peak[beyond], right[beyond])
    index = np.concatenate([index[beyond], index[beyond], index[touch]])
    return index, np.concatenate([before, after, peak[touch]])
