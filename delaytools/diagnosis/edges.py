"""Where an edge of a window of gain lies: χ² for every row near it, and what that leaves open.

An edge in noise is no value with a derivative: χ² has a peak as narrow as a row where the jump shows by itself, and
wide uneven hills where only the stretch beside it tells (Hinkley 1970). So every row is looked at, all at the cost
of a few responses, and the error is the spread under exp(χ²/2).
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added, path_of
from delaytools.diagnosis.screen import Base, response
from delaytools.diagnosis.wire_changes import change_at
from delaytools.diagnosis.wires import Way, own_way

__all__ = ["EDGES", "changed_at_port", "edge_beside", "edge_near"]

Array = NDArray[np.float64]
EDGES = ("start", "end")
SMALL = 0.02
NEARBY = 0.1  # of a window's length or of its answer: how far an edge moves about a fit, whose derivatives it changes
FARTHEST = 1.0  # s from the place where it was taken to be
AS_GOOD = 4.0  # χ² by which the middle of the places may be worse than the best


def edge_near(base: Base, way: Way, one: Added, side: int) -> tuple[float, float] | None:
    """Where the start (side 0) or end (side 1) of a window of gain lies, and its standard error (s), by every row near
    the one that it has; None where a window changes nothing. The way is one that can be convolved."""
    step, edges = base.case.step, (one.values["start"], one.values["end"])
    first, last = (int(np.ceil(edge / step - 1e-6)) for edge in edges)  # first row inside, first row behind
    window = one.moved({"factor": 1 + SMALL, "start": (first - 0.5) * step, "end": (last - 0.5) * step})
    change, row = response(base, window), (first, last)[side]
    if change is None or not np.any(change):
        return None
    shifts = _shifts(base, (first, last), side)
    behind = max(map(len, base.case.records)) - row
    gains = _gains(base, way, (base.projected(change), 2 * side - 1), (row, shifts))
    if side and shifts[-1] == behind:  # of pulses in the last rows a log does not show all
        whole = response(base, window.moved({"end": (row + behind - 0.5) * step}))
        gains[-1] = gains[-1] if whole is None else base.gain(whole)[0]
    return _placed((row + shifts - 0.5) * step, gains, step)


def edge_beside(base: Base, way: Way, one: Added, side: int) -> tuple[float, float, float]:
    """As `edge_near`, of a window that the base's hypothesis has: about its fit, all that was fitted with it free; and
    the χ² that the new place takes off.

    Δχ² = 2 rᵀd - |d|², d what the rows between do by the window's own factor. A hypothesis without the window has
    other derivatives by what is free, which count where the window changes much.
    """
    step, edges = base.case.step, (one.values["start"], one.values["end"])
    first, last = (int(np.ceil(edge / step - 1e-6)) for edge in edges)
    shifts, factor = _shifts(base, (first, last), side), one.values["factor"]
    signals = tuple((factor - 1) / SMALL * rows for rows in changed_at_port(base, way))
    for rows in signals:  # behind the window, as the port is
        rows[first:last] /= factor if abs(factor) > SMALL else 1.0
    between = _Between(signals, (first, last)[side], shifts)
    along = (2 * side - 1) * between.summed(way.weights(base.residual))
    power, whole = _power(base, way, between)
    near = (np.abs(shifts) <= NEARBY * (last - first)) | (whole <= NEARBY**2 * _own_power(base, factor))
    places, gains = (between.row + shifts - 0.5) * step, np.where(near, 2 * along - power, -np.inf)
    place, error = _placed(places, gains, step)
    return place, error, float(np.interp(place, places, gains))


def _own_power(base: Base, factor: float) -> float:
    """χ² of the answer to the last effect of the base's hypothesis, a window of this factor."""
    path = path_of(len(base.fitted.added) - 1, "factor")
    column = next(k for k, p in enumerate(base.fitted.parameters) if p.path == path)
    return float(np.sum(((factor - 1) * base.fitted.jacobian[:, column]) ** 2))


def _shifts(base: Base, rows: tuple[int, int], side: int) -> NDArray[np.int64]:
    """By how many rows an edge may move: not beyond the middle of the window, nor the ends of the longest log."""
    outwards = int(FARTHEST / base.case.step)
    inwards = min(outwards, (rows[1] - rows[0]) // 2)
    back, on = (inwards, outwards) if side else (outwards, inwards)
    behind = max(map(len, base.case.records)) - rows[side]
    return np.arange(-min(back, rows[side]), max(min(on, behind), 0) + 1)


def _placed(places: Array, gains: Array, step: float) -> tuple[float, float]:
    """The middle of where the edge may lie, or the best place where the middle is clearly worse; and the spread."""
    best = int(np.argmax(gains))
    weights = np.exp(0.5 * (gains - gains[best]))
    weights /= weights.sum()
    middle = float(weights @ places)
    place = middle if np.interp(middle, places, gains) > gains[best] - AS_GOOD else float(places[best])
    return max(place, 0.0), float(np.sqrt(weights @ (places - place) ** 2 + step**2 / 12))


def _gains(base: Base, way: Way, window: tuple[Array, int], rows: tuple[int, Array]) -> Array:
    """(shifts,): χ² that the window takes off at its best scale, an edge moved by so many rows.

    window: its whitened change, what free values do projected out, and 1 where a later edge makes it longer, else -1.
    rows: of the edge, and its shifts. c = r·(w ± d), p = |w ± d|², d the change of the rows between; c²/p.
    """
    (own, sign), (row, shifts) = window, rows
    between = _Between(changed_at_port(base, way), row, shifts)
    along = float(own @ base.residual) + sign * between.summed(way.weights(base.residual))
    power = float(own @ own) + 2 * sign * between.summed(way.weights(own)) + _power(base, way, between)[0]
    return np.divide(along**2, power, out=np.zeros_like(power), where=power > 0)


def _power(base: Base, way: Way, between: "_Between") -> tuple[Array, Array]:
    """(shifts,): χ² of the rows between an edge and its shifted place, what free values can do left out; and in all."""
    every = max(way.every, 1)
    tick = max((between.row + int(between.shifts[0] + between.shifts[-1]) // 2) // every, 1) * every
    pulse = tuple(np.zeros(len(rows)) for rows in between.signals)
    for one in pulse:
        one[min(tick, (len(one) - 1) // every * every)] = 1.0
    answer = way.convolved(pulse)
    assert answer is not None
    together = tuple(map(_by_lag, way.weights(base.case.whitened(answer)), pulse))
    whole = between.squared(together)
    found = whole.copy()
    for column in base.basis.T:
        found -= between.summed(way.weights(column)) ** 2
    return np.maximum(found, 0.0), whole


def _by_lag(along: Array, pulse: Array) -> Array:
    """(lags,): how two pulses go together by the rows between them, from one pulse (n,) and all along it (n,)."""
    row = int(np.argmax(pulse))
    return along[row:] if row < len(along) // 2 else along[row::-1]


def changed_at_port(base: Base, way: Way) -> tuple[Array, ...]:
    """Per log (n,): what a window of gain changes at each row of its wire."""
    element = own_way(base.view, Added("scale_factor", str(way.port), {"factor": 1 + SMALL}))
    changes = None if element is None else change_at(base.view, way.port, element)
    assert changes is not None
    return tuple(way.read(rows) for rows in changes)


@final
@dataclass(frozen=True, eq=False)
class _Between:
    """The rows between an edge and its shifted places; signals: per log (n,) what changes at the port."""

    signals: tuple[Array, ...]
    row: int
    shifts: Array

    def summed(self, weights: tuple[Array, ...]) -> Array:
        """(shifts,): Σ of weights (n,) times the change over the rows between, negative for an earlier place."""
        found = np.zeros(len(self.shifts))
        for u, w in zip(self.signals, weights, strict=True):
            sums = np.concatenate([[0.0], np.cumsum(u * w)])
            places = np.minimum(self.row + self.shifts, len(u))
            found += sums[places] - sums[min(self.row, len(u))]
        return found

    def squared(self, together: tuple[Array, ...]) -> Array:
        """(shifts,): Σ u_i u_k g(|i - k|) over the rows between; together: per log g (lags,)."""
        found = np.zeros(len(self.shifts))
        for u, g in zip(self.signals, together, strict=True):
            row = min(self.row, len(u))
            for way, part in ((-1, u[max(row + self.shifts[0], 0) : row][::-1]), (1, u[row : row + self.shifts[-1]])):
                sums, here = _grown(part, g), way * self.shifts > 0
                found[here] += sums[np.minimum(np.abs(self.shifts[here]), len(part))]
        return found


def _grown(part: Array, g: Array) -> Array:
    """(n + 1,): Σ u_i u_k g(|i - k|) over the first 0, 1, … n rows of a part (n,)."""
    if not len(part):
        return np.zeros(1)
    lags = np.concatenate([g, np.zeros(len(part))])[: len(part)]
    return np.concatenate([[0.0], np.cumsum(part * (2 * np.convolve(part, lags)[: len(part)] - lags[0] * part))])
