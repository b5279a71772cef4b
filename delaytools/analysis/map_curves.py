"""Crossing curves of two parameters in closed form: at each frequency the pairs that bring a root there.

P(s), (2, 2), is what enters two places of the loop over what leaves them. With z = e^{-jωτ} at the first and v at the
second, a root is at jω where F = 1 - P₁₁ z - P₂₂ v + det P z v = 0. One of two conditions on v leaves A + Re(q z) = 0,
so two z at most: a second delay has |v| = 1 (Gu, Niculescu & Chen, J. Math. Anal. Appl. 311 (2005) 231, there for
det P = 0), a factor is real.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from delaytools.linear.delay_system import DelaySystem

__all__ = ["CrossingCurve", "Span", "delay_curves", "factor_curves"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Span = tuple[float, float]
DENSER = 6  # points of a curve between two of the frequencies that are given
NEARBY = 1e-4  # of a frequency, for a slope
POINTS = 24  # of a line along the delay


@final
@dataclass(frozen=True, eq=False)
class CrossingCurve:
    """Points (x, y) at which roots ±j frequency lie on the imaginary axis (rad/s; 0: a real one).

    x, y, frequency: (n,). towards (n, 2): along x and y, to the side on which the root is unstable, at right angles to
    the curve; its length means nothing.
    """

    x: Array
    y: Array
    frequency: Array
    towards: Array


@final
@dataclass(frozen=True, eq=False)
class _Parts:
    """P₁₁, P₂₂ and det P at some frequencies (n,)."""

    first: ComplexArray
    second: ComplexArray
    both: ComplexArray


Condition = Callable[[_Parts], tuple[Array, ComplexArray]]  # -> A, q


def delay_curves(opened: DelaySystem, spans: tuple[Span, Span], net: Array) -> Iterator[CrossingCurve]:
    """Over the first and the second delay in s; net: frequencies in rad/s between which P hardly bends."""
    for omega, z, v in _solved(opened, net, _on_the_circle):
        angles = [-np.unwrap(np.angle(part)) for part in (z, v)]
        slope, by_z, by_v = _derivatives(opened, omega, z, v)
        for m, n in product(*(_turns(angle, omega, span) for angle, span in zip(angles, spans, strict=True))):
            tau, other = (angles[0] + 2 * np.pi * m) / omega, (angles[1] + 2 * np.pi * n) / omega
            moved = slope - tau * by_z - other * by_v
            towards = [(1j * omega * part / moved).real for part in (by_z, by_v)]
            yield from _inside(spans, (tau, other, omega, np.stack(towards, axis=1)))


def factor_curves(opened: DelaySystem, spans: tuple[Span, Span], net: Array) -> Iterator[CrossingCurve]:
    """Over the delay in s at the first place and a factor > 0 at the second; the line of a real root at 0 as well."""
    for whole, every_z, every_v in _solved(opened, net, _real):
        for part in _runs((every_v.real >= spans[1][0]) & (every_v.real <= spans[1][1])):
            omega, z, v = whole[part], every_z[part], every_v[part]
            angle, k = -np.unwrap(np.angle(z)), v.real
            slope, by_z, by_v = _derivatives(opened, omega, z, v)
            for m in _turns(angle, omega, spans[0]):
                tau = (angle + 2 * np.pi * m) / omega
                moved = slope - tau * by_z
                towards = [(1j * omega * by_z / moved).real, (-by_v / k / moved).real]
                yield from _inside(spans, (tau, k, omega, np.stack(towards, axis=1)))
    yield from _real_root(opened, spans, float(net[0]))


def _solved(
    opened: DelaySystem, net: Array, condition: Condition
) -> Iterator[tuple[Array, ComplexArray, ComplexArray]]:
    """Stretches of frequency with one z of each side, and v."""
    for omega in _feasible(opened, net, condition):
        parts = _parts(opened, omega)
        even, q = condition(parts)
        for side in (1.0, -1.0):
            z = np.exp(1j * (side * np.arccos(np.clip(-even / np.abs(q), -1, 1)) - np.angle(q)))
            yield omega, z, (1 - parts.first * z) / (parts.second - parts.both * z)


def _on_the_circle(parts: _Parts) -> tuple[Array, ComplexArray]:
    """|1 - P₁₁ z|² = |P₂₂ - det P z|² as A + Re(q z) = 0."""
    first, second, both = (np.abs(part) ** 2 for part in (parts.first, parts.second, parts.both))
    return 1 + first - second - both, 2 * (parts.second.conj() * parts.both - parts.first)


def _real(parts: _Parts) -> tuple[Array, ComplexArray]:
    """Im (1 - P₁₁ z) conj(P₂₂ - det P z) = 0 as A + Re(q z) = 0."""
    even = (parts.second.conj() + parts.first * parts.both.conj()).imag
    return even, -1j * (parts.both - parts.first * parts.second.conj())


def _derivatives(
    opened: DelaySystem, omega: Array, z: ComplexArray, v: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """∂F/∂s at jω with z and v as they are, z ∂F/∂z and v ∂F/∂v."""
    step = NEARBY * omega
    here, after, before = (_parts(opened, at) for at in (omega, omega + step, omega - step))
    first, second, both = (
        (getattr(after, name) - getattr(before, name)) / (2j * step) for name in ("first", "second", "both")
    )
    slope = both * z * v - first * z - second * v
    return slope, z * (here.both * v - here.first), v * (here.both * z - here.second)


def _parts(opened: DelaySystem, omega: Array) -> _Parts:
    P = opened.frequency_response(omega)
    return _Parts(P[:, 0, 0], P[:, 1, 1], P[:, 0, 0] * P[:, 1, 1] - P[:, 0, 1] * P[:, 1, 0])


def _feasible(opened: DelaySystem, net: Array, condition: Condition) -> Iterator[Array]:
    """Stretches of frequency in which there is a z, both ends exact."""

    def room(omega: Array) -> Array:
        even, q = condition(_parts(opened, omega))
        return np.asarray((np.abs(q) - np.abs(even)) / (np.abs(q) + np.abs(even)))

    nodes = np.log(net)
    at = np.arange(0, len(nodes) - 1 + 0.5 / DENSER, 1 / DENSER)
    omega = np.exp(np.interp(at, np.arange(len(nodes)), nodes))
    there = room(omega) >= 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        ends = [_end(room, omega[k - 1], omega[k]) for k in (first, last) if 0 < k < len(omega)]
        stretch = np.unique(np.concatenate([omega[first:last], ends]))
        if len(stretch) > 1:
            yield stretch


def _end(room: Callable[[Array], Array], low: float, high: float) -> float:
    """Where the room between two frequencies becomes none, on the side where it is."""

    def at(omega: float) -> float:
        return float(room(np.array([omega]))[0])

    edge = float(brentq(at, low, high, xtol=1e-15 * high, rtol=1e-14))
    aside = edge * (1 + (1e-13 if at(high) >= 0 else -1e-13))
    return aside if at(aside) >= 0 else edge


def _turns(angle: Array, omega: Array, span: Span) -> range:
    """Whole turns of a delay with which some of its values lie in a range."""
    low, high = ((edge * omega - angle) / (2 * np.pi) for edge in span)
    return range(int(np.ceil(low.min())), int(np.floor(high.max())) + 1)


def _inside(spans: tuple[Span, Span], rows: tuple[Array, Array, Array, Array]) -> Iterator[CrossingCurve]:
    """The stretches of a curve that lie in the plane, each with a point more at either end."""
    inside = np.ones(len(rows[0]), dtype=bool)
    for part, (low, high) in zip(rows, spans, strict=False):
        inside &= (part >= low) & (part <= high)
    for one in _runs(inside):
        yield CrossingCurve(*(part[one] for part in rows))


def _runs(inside: NDArray[np.bool_]) -> Iterator[slice]:
    """Where it holds, with a point more at either end."""
    wide = inside.copy()
    wide[:-1] |= inside[1:]
    wide[1:] |= inside[:-1]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wide, [False]]).astype(int)))
    yield from (slice(first, last) for first, last in zip(edges[::2], edges[1::2], strict=True))


def _real_root(opened: DelaySystem, spans: tuple[Span, Span], slowest: float) -> Iterator[CrossingCurve]:
    """The factor with which a real root is at 0, whatever the delay."""
    step = NEARBY * slowest
    P = [opened(s).real for s in (0.0, step, -step)]
    with np.errstate(invalid="ignore", over="ignore"):  # a pole at 0
        here, after, before = ((p[0, 0], p[1, 1], p[0, 0] * p[1, 1] - p[0, 1] * p[1, 0]) for p in P)
    bottom = here[1] - here[2]
    if not np.isfinite(here).all() or bottom == 0:
        return
    k = (1 - here[0]) / bottom
    if not spans[1][0] <= k <= spans[1][1]:
        return
    first, second, both = ((a - b) / (2 * step) for a, b in zip(after, before, strict=True))
    x = np.linspace(*spans[0], POINTS)
    moved = both * k - first - second * k - x * (here[2] * k - here[0])
    towards = np.stack([0 * x, bottom / moved], axis=1)
    yield CrossingCurve(x, np.full(POINTS, k), np.zeros(POINTS), towards)
