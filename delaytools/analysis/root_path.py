"""Roots followed from one value of a parameter to another, and the value at which two of them meet."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

__all__ = ["Family", "Line", "Meeting", "Path", "crossing_of", "follow", "meeting"]

ComplexArray = NDArray[np.complex128]
Line = Callable[[float], float]  # value of the parameter -> Re s, rad/s
BEND = 0.1  # of a root's move: as far from the straight line of the last step it may come out
STILL = 1e-3  # of a root's size: moves below this may bend as they like
SAME = 1e-7  # of a root's size: two that lie nearer are one
GROWTH, SHORTEST = 1.6, 2.0**-14  # of a step after one that was taken; of the range: where shorter, a root is stuck
NEARER = (0.1, 0.01, 0.001)  # of the way across a meeting: where its roots are looked at
PROBE = 1e-7  # of the range: step of a first slope


class Family(Protocol):
    """Roots against a parameter, as points w of a plane with a real axis on which two may meet: s itself, or z."""

    def corrected(self, value: float, guesses: ComplexArray) -> tuple[ComplexArray, NDArray[np.bool_]]:
        """The roots next to the guesses (k,) at a value of the parameter, and which of these were reached."""

    def s(self, points: ComplexArray) -> ComplexArray:
        """The points as s in rad/s."""


@final
@dataclass(eq=False)
class Path:
    """One root so far: values of the parameter and points, and how it ended: "end", "left" of the line, "stuck"."""

    values: list[float]
    points: list[complex]
    how: str = ""


@final
@dataclass(frozen=True)
class Meeting:
    """Two roots meet at `point` at a value; beyond it, at `after`, they are at `points`: two real ones, or one of a
    pair."""

    value: float
    point: complex
    after: float
    points: tuple[complex, ...]


def follow(
    family: Family, points: ComplexArray, ends: tuple[float, float], line: Line, longest: float
) -> list[Path]:
    """Every root from one end of a range to the other, by a straight line ahead and a correction, in steps of at most
    `longest` of it; until it leaves to the left of Re s = line(value)."""
    begin, end = ends
    paths = [Path([begin], [complex(point)]) for point in points]
    value, step = begin, longest * (end - begin)
    now, slope = np.array(points, dtype=complex), _slopes(family, begin, points, PROBE * (end - begin))
    active = np.arange(len(now))
    while len(active) and value != end:
        last = abs(end - value) <= abs(step) * (1 + 1e-9)
        there = end if last else value + step
        found, good = _stepped(family, now[active], slope[active], (value, there))
        if not good.all() and abs(step) > SHORTEST * abs(end - begin):
            step /= 2
            continue
        for k in active[~good]:
            paths[k].how = "stuck"
        active, found = active[good], found[good]
        slope[active] = (found - now[active]) / (there - value)
        now[active], value = found, there
        for k, point in zip(active, found, strict=True):
            paths[k].values.append(value)
            paths[k].points.append(complex(point))
        gone = family.s(found).real < line(value)
        for k in active[gone]:
            paths[k].how = "left"
        active = active[~gone]
        step = np.sign(end - begin) * min(GROWTH * abs(step), longest * abs(end - begin))
    for k in active:
        paths[k].how = "end"
    return paths


def _stepped(
    family: Family, now: ComplexArray, slope: ComplexArray, span: tuple[float, float]
) -> tuple[ComplexArray, NDArray[np.bool_]]:
    """The roots a step further, and which of them were surely followed."""
    value, there = span
    guesses = now + (there - value) * slope
    guesses = np.where(now.imag == 0, guesses.real, guesses.real + 1j * np.abs(guesses.imag))
    found, good = family.corrected(there, guesses)
    size = np.abs(found) + np.abs(now)
    good &= np.abs(found - guesses) <= np.maximum(BEND * np.abs(found - now), STILL * size)
    good &= np.where(now.imag > 0, found.imag > SAME * size, found.imag == 0)  # a pair's guess may fall on a real root
    apart = np.abs(found[:, None] - found[None, :]) + np.where(np.eye(len(found)), np.inf, 0.0)
    return found, good & (apart.min(axis=1, initial=np.inf) > SAME * size)


def _slopes(family: Family, value: float, points: ComplexArray, step: float) -> ComplexArray:
    """By a first small step; 0 where a root is not found again."""
    found, good = family.corrected(value + step, points)
    return np.where(good, (found - points) / step, 0.0)


def meeting(family: Family, paths: tuple[Path, ...]) -> Meeting | None:
    """Where two stuck real roots meet, or where one of a pair meets the other; None where they do not.

    With mean m and d = (half their difference)², both smooth where the roots are not: d is 0 where they meet, above it
    on the real axis, below it off it. By polynomials through d at values ever nearer, each from the roots themselves:
    there they are still apart and well known, where they meet they are not.
    """
    known = [_pair_before(paths, place) for place in (-2, -1)]
    if min(len(path.values) for path in paths) < 2 or any(pair is None for pair in known):
        return None
    (p0, m0, d0), (p1, m1, d1) = (pair for pair in known if pair is not None)
    if p0 == p1 or d0 == d1 or d1 * (d1 - d0) >= 0:  # it does not come nearer to 0
        return None
    after = p1 - 2 * d1 * (p1 - p0) / (d1 - d0)
    beyond = _pair(family, after, m1 + (after - p1) * (m1 - m0) / (p1 - p0), -d1)
    if beyond is None or beyond[1] * d1 >= 0:
        return None
    values, pairs = [p0, p1, after], [(m0, d0), (m1, d1), beyond]
    found = _met(values, pairs)
    for part in NEARER:
        values = [found[0] + part * (after - p1) * side for side in (-1.5, -0.5, 0.5, 1.5)]
        near = [_pair(family, p, *_at(found, p)) for p in values]
        if any(pair is None for pair in near):
            break
        found = _met(values, [pair for pair in near if pair is not None])
    m, d = beyond
    points = (complex(m + d**0.5), complex(m - d**0.5)) if d > 0 else (complex(m, (-d) ** 0.5),)
    return Meeting(found[0], complex(found[1][-1]), after, points)


_Met = tuple[float, NDArray[np.float64], NDArray[np.float64]]


def _met(values: list[float], pairs: list[tuple[float, float]]) -> _Met:
    """Where d is 0 by a polynomial through its values, and the polynomials of m and d about there."""
    at = values[1]
    span = max(values) - min(values)
    square = np.polyfit([(p - at) / span for p in values], [d for _, d in pairs], len(values) - 1)
    roots = np.roots(square)
    nearest = float(roots[np.argmin(np.abs(roots.imag) + np.maximum(np.abs(roots.real) - 1, 0))].real)
    value = float(at + span * nearest)
    parts = [np.polyfit([p - value for p in values], [pair[k] for pair in pairs], len(values) - 1) for k in (0, 1)]
    return value, parts[0], parts[1]


def _at(met: _Met, value: float) -> tuple[float, float]:
    """Mean and squared half difference at a value by the polynomials."""
    return float(np.polyval(met[1], value - met[0])), float(np.polyval(met[2], value - met[0]))


def _pair_before(paths: tuple[Path, ...], place: int) -> tuple[float, float, float] | None:
    """Value, mean and squared half difference of two real roots, or of one off the axis and its conjugate."""
    if min(len(path.values) for path in paths) < -place:
        return None
    if len(paths) == 1:
        point = paths[0].points[place]
        return paths[0].values[place], point.real, -(point.imag**2)
    one, other = (path.points[place].real for path in paths)
    return paths[0].values[place], (one + other) / 2, ((one - other) / 2) ** 2


def _pair(family: Family, value: float, mean: float, square: float) -> tuple[float, float] | None:
    """Mean and squared half difference at a value, from a guess of them; None where it leads to one root only."""
    half = np.sqrt(complex(square))
    found, good = family.corrected(value, np.array([mean + half, mean - half]))
    if not good.all() or abs(found[0] - found[1]) < 1e-12 * abs(mean):
        return None
    square = ((found[0] - found[1]) / 2) ** 2
    return float((found[0] + found[1]).real / 2), float(square.real)


def crossing_of(
    family: Family, path: tuple[tuple[float, complex], tuple[float, complex]], height: Callable[[complex], float]
) -> tuple[float, complex]:
    """Where a root followed from one value to another has height 0: the value and the point there."""
    (first, w0), (last, w1) = path

    def at(value: float) -> complex:
        part = (value - first) / (last - first)
        return complex(family.corrected(value, np.array([w0 + part * (w1 - w0)]))[0][0])

    value = float(brentq(lambda p: height(at(p)), first, last, xtol=1e-15 * abs(last - first) + 1e-300, rtol=1e-14))
    return value, at(value)
