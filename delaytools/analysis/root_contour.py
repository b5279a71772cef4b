"""How many roots a box holds: the argument principle, with a bound that keeps every step of the phase below pi.

f(s) = det G(s), G = I - (c(s) - gamma) P(s), on an edge of half length h about p. With K a bound of
|G(p)^-1 (G(s) - G(p))| for |s - p| <= h, entry by entry, and rho(K) < 1, every eigenvalue of G(p)^-1 G(s) stays right
of the imaginary axis: the change of arg f is the sum of their arguments at an end, and nothing is aliased.
An interval that does not pass is halved, for all systems of the batch together.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur

from delaytools.analysis.root_bounds import Box, ShiftedLoop, shifted_loop
from delaytools.linear.channel import Delay
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.matrices import RealMatrix

__all__ = ["Counts", "counted_in"]

ComplexArray = NDArray[np.complex128]
_LEVELS = 45
_MOST_STEPS = 20_000  # per system, waiting at one level


@final
@dataclass(frozen=True, eq=False)
class Counts:
    """numbers: roots in the box, per system; reached: False where a root lies on (or too near) the edge."""

    numbers: NDArray[np.int64]
    reached: NDArray[np.bool_]


def counted_in(system: DelaySystem, spans: RealMatrix, box: Box) -> Counts:
    """The number of characteristic roots in the box, with multiplicity, for each row of `spans` (k, m).

    N = poles of P in the box + (change of arg f along the upper half of the edge)/pi
    """
    loop = shifted_loop(system, box.left)
    loop_values = _LoopValues.of(loop)
    start, end = _first_intervals(box)
    owner, which = (index.ravel() for index in np.indices((len(spans), len(start))))
    phase, reached = np.zeros(len(spans)), np.ones(len(spans), dtype=bool)
    for _ in range(_LEVELS):
        edge = loop_values.on(start, end)
        change, passed = _phase_steps(system, loop, edge, spans[owner], which)
        np.add.at(phase, owner[passed], change[passed])
        owner, which = owner[~passed], which[~passed]
        if not len(owner) or len(owner) > _MOST_STEPS * len(spans):
            break
        start, end, owner, which = _halved(start, end, owner, which)
    reached[owner] = False
    turns = phase / np.pi
    reached &= np.abs(turns - np.round(turns)) < 1e-3
    return Counts(np.round(turns).astype(int) + _poles_in(loop, box), reached)


@final
@dataclass(frozen=True, eq=False)
class _Edge:
    """P at the start, middle p and end of each interval (k, m, m); C R and R B at p; and bounds of P's change.

    R = (pI - T)^-1; |P(s) - P(p)| <= change = h |C R R B| + h^2 |C R| tail, inf where h reaches a pole of P.
    """

    points: tuple[ComplexArray, ComplexArray, ComplexArray]
    half: RealMatrix
    values: tuple[ComplexArray, ComplexArray, ComplexArray]
    left: ComplexArray
    right: ComplexArray
    tail: RealMatrix
    change: RealMatrix


@final
@dataclass(frozen=True, eq=False)
class _LoopValues:
    """P(s) = C (sI - T)^-1 B + D with T upper triangular (Schur form)."""

    T: ComplexArray
    B: ComplexArray
    C: ComplexArray
    D: RealMatrix

    @classmethod
    def of(cls, loop: ShiftedLoop) -> "_LoopValues":
        if not len(loop.A):
            empty = np.zeros((0, 0), dtype=complex)
            return cls(empty, loop.B.astype(complex), loop.C.astype(complex), loop.D)
        T, Z = schur(loop.A, output="complex")
        return cls(T, Z.conj().T @ loop.B, loop.C @ Z, loop.D)

    def on(self, start: ComplexArray, end: ComplexArray) -> _Edge:
        middle, half = (start + end) / 2, np.abs(end - start) / 2
        resolvent = self._resolvent(middle)
        left, right = self.C @ resolvent, resolvent @ self.B
        step = half[:, None, None]
        inside = np.eye(len(self.T)) - step * np.abs(resolvent)
        near = np.any(half[:, None] >= 0.999 * np.abs(middle[:, None] - np.diag(self.T)), axis=1)
        inside[near] = np.eye(len(self.T))
        tail = np.abs(resolvent) @ np.linalg.solve(inside, np.abs(right))
        change = step * np.abs(left @ right) + step**2 * np.abs(left) @ tail
        change[near] = np.inf
        values = (self._value(start), left @ self.B + self.D, self._value(end))
        return _Edge((start, middle, end), half, values, left, right, tail, change)

    def _resolvent(self, s: ComplexArray) -> ComplexArray:
        unit = np.eye(len(self.T))
        return np.asarray(np.linalg.inv(s[:, None, None] * unit - self.T), dtype=complex)

    def _value(self, s: ComplexArray) -> ComplexArray:
        return self.C @ self._resolvent(s) @ self.B + self.D


def _first_intervals(box: Box) -> tuple[ComplexArray, ComplexArray]:
    """The upper half of the box's edge, counterclockwise from its real right end to its real left end."""
    heights = box.top * np.concatenate([[0.0], 2.0 ** np.arange(-12, 0), [0.75, 1.0]])
    up = box.right + 1j * heights
    across = np.linspace(box.right, box.left, 4)[1:-1] + 1j * box.top
    down = box.left + 1j * heights[::-1]
    path = np.concatenate([up, across, down])
    return path[:-1], path[1:]


def _halved(
    start: ComplexArray, end: ComplexArray, owner: NDArray[np.int64], which: NDArray[np.int64]
) -> tuple[ComplexArray, ComplexArray, NDArray[np.int64], NDArray[np.int64]]:
    """The intervals still needed, each in two halves, and who needs them."""
    needed, position = np.unique(which, return_inverse=True)
    first, last = start[needed], end[needed]
    middle = (first + last) / 2
    return (
        np.concatenate([first, middle]),
        np.concatenate([middle, last]),
        np.concatenate([owner, owner]),
        np.concatenate([position, position + len(needed)]),
    )


def _phase_steps(
    system: DelaySystem, loop: ShiftedLoop, edge: _Edge, spans: RealMatrix, which: NDArray[np.int64]
) -> tuple[RealMatrix, NDArray[np.bool_]]:
    """The change of arg f over each step, and whether it is proved not to be aliased on either half."""
    m = system.n_channels
    if m == 0:
        return np.zeros(len(which)), np.ones(len(which), dtype=bool)
    channel = [_channels_at(system, s[which], spans) - loop.gamma for s in edge.points]
    difference = [np.eye(m) - c[:, :, None] * P[which] for c, P in zip(channel, edge.values, strict=True)]
    inverse, moved = _inverse(difference[1]), _channel_change(system, edge, spans, which)
    change = np.zeros(len(which))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        passed = _radius_bound(_relative_change(edge, which, inverse, channel[1], moved)) < 0.98
        first, last = (_argument(inverse[passed] @ difference[k][passed]) for k in (0, 2))
    change[passed] = last - first
    passed[passed] = np.isfinite(change[passed])
    return change, passed


def _relative_change(
    edge: _Edge, which: NDArray[np.int64], inverse: ComplexArray, channel: ComplexArray, moved: RealMatrix
) -> RealMatrix:
    """K >= |G(p)^-1 (G(s) - G(p))| = |G^-1 ((c - gamma) dP + dc (P + dP))|; the first-order part of dP kept signed."""
    half = edge.half[which, None, None]
    closed = (inverse * channel[:, None, :]) @ edge.left[which]
    rational = half * np.abs(closed @ edge.right[which]) + half**2 * (np.abs(closed) @ edge.tail[which])
    carried = np.abs(edge.values[1])[which] + edge.change[which]
    return rational + (np.abs(inverse) * moved[:, None, :]) @ carried


def _channel_change(
    system: DelaySystem, edge: _Edge, spans: RealMatrix, which: NDArray[np.int64]
) -> RealMatrix:
    """A bound of |c(s) - c(p)| over each step, (k, m): by the slope, at most twice the largest value."""
    moved = np.empty_like(spans)
    lowest = np.minimum(edge.points[0].real, edge.points[2].real)[which]
    for i, channel in enumerate(system.channels):
        x = lowest * spans[:, i]
        mean_age = 1.0 if isinstance(channel, Delay) else 0.5
        slope = mean_age * spans[:, i] * np.exp(-x if isinstance(channel, Delay) else -np.minimum(x, 0.0))
        moved[:, i] = np.minimum(edge.half[which] * slope, 2 * channel.kappa(x).real)
    return moved


def _channels_at(system: DelaySystem, s: ComplexArray, spans: RealMatrix) -> ComplexArray:
    values = [channel.kappa(s * spans[:, i]) for i, channel in enumerate(system.channels)]
    return np.stack(values, axis=-1)


def _argument(matrix: ComplexArray) -> RealMatrix:
    """arg det of matrices (k, m, m) near I, eigenvalue by eigenvalue: those of two turn by less than pi together."""
    if matrix.shape[-1] == 1:
        return np.angle(matrix[:, 0, 0])
    if matrix.shape[-1] == 2:
        return np.angle(matrix[:, 0, 0] * matrix[:, 1, 1] - matrix[:, 0, 1] * matrix[:, 1, 0])
    return np.asarray(np.angle(np.linalg.eigvals(matrix)).sum(axis=1))


def _inverse(matrix: ComplexArray) -> ComplexArray:
    """Inverses of a stack; nan where one is singular."""
    if matrix.shape[-1] == 1:
        unit: ComplexArray = np.ones_like(matrix)
        unit /= matrix
        return unit
    singular = np.abs(np.linalg.det(matrix)) == 0.0
    inverse = np.linalg.inv(np.where(singular[:, None, None], np.eye(matrix.shape[-1]), matrix))
    inverse[singular] = np.nan
    return np.asarray(inverse, dtype=complex)


def _radius_bound(matrix: RealMatrix) -> RealMatrix:
    """An upper bound of the spectral radius of each nonnegative matrix: max (K v)/v (Collatz, Wielandt)."""
    if matrix.shape[-1] == 1:
        return matrix[:, 0, 0]
    v = np.ones(matrix.shape[:-1])
    for _ in range(4):
        v = np.einsum("kij,kj->ki", matrix, v) + 1e-12
        v = v / v.max(axis=1, keepdims=True) + 1e-9
    return np.max(np.einsum("kij,kj->ki", matrix, v) / v, axis=1)


def _poles_in(loop: ShiftedLoop, box: Box) -> int:
    inside = (
        (loop.poles.real > box.left) & (loop.poles.real < box.right) & (np.abs(loop.poles.imag) < box.top)
    )
    return int(np.sum(inside))
