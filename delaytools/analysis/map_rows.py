"""A stability map made of rows: at each value of one parameter the other's crossings, joined from row to row."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from delaytools.analysis.map_curves import CrossingCurve

__all__ = ["Row", "joined_rows"]

Array = NDArray[np.float64]
FAR = 0.15  # of a range, in place or in frequency: crossings of neighbouring rows that lie further apart are not one
HALVINGS = 4  # of the way between two rows of which some crossings find none


@final
@dataclass(frozen=True, eq=False)
class Row:
    """Along x at one y: crossings `at` (n,), rising, frequency (n,) in rad/s, unstable roots in between (n+1,)."""

    at: Array
    frequency: Array
    counts: NDArray[np.int_]

    def counted(self, x: Array) -> Array:
        """(x,) unstable roots at places that are no crossing."""
        return self.counts[np.searchsorted(self.at, x)].astype(float)


def joined_rows(
    row: Callable[[float], Row], y: Sequence[float], width: float
) -> tuple[tuple[CrossingCurve, ...], tuple[Row, ...]]:
    """The crossing curves over a range of x so wide, and the rows at `y`."""
    rows = [(float(value), row(float(value))) for value in y]
    fine = rows[:1]
    for here in rows[1:]:
        fine += _between(row, fine[-1], here, (width, HALVINGS))
    return tuple(_chains(fine, width)), tuple(one for _, one in rows)


def _between(
    row: Callable[[float], Row], first: tuple[float, Row], last: tuple[float, Row], how: tuple[float, int]
) -> list[tuple[float, Row]]:
    """Rows behind the first up to the last, halved where crossings appear or disappear."""
    width, halvings = how
    pairs = _pairs(first[1], last[1], width)
    if halvings == 0 or (len(pairs) == len(first[1].at) == len(last[1].at)):
        return [last]
    middle = 0.5 * (first[0] + last[0])
    half = middle, row(middle)
    return [*_between(row, first, half, (width, halvings - 1)), *_between(row, half, last, (width, halvings - 1))]


def _pairs(first: Row, last: Row, width: float) -> list[tuple[int, int]]:
    """Which crossings of two rows are one: near in place and frequency, and in the same direction."""
    if not len(first.at) or not len(last.at):
        return []
    scale = max(float(first.frequency.max()), float(last.frequency.max()), 1e-300)
    apart = np.abs(first.at[:, None] - last.at) / width + np.abs(first.frequency[:, None] - last.frequency) / scale
    ways = [np.sign(np.diff(one.counts)) for one in (first, last)]
    apart[(ways[0][:, None] != ways[1]) | (apart > FAR)] = 1e6
    rows, columns = linear_sum_assignment(apart)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if apart[i, j] < 1e6]


def _chains(rows: list[tuple[float, Row]], width: float) -> list[CrossingCurve]:
    """Crossings of successive rows joined into curves."""
    done: list[list[tuple[float, float, float, float]]] = []
    open_: dict[int, list[tuple[float, float, float, float]]] = {}
    for place, (y, row) in enumerate(rows):
        linked = {j: i for i, j in _pairs(rows[place - 1][1], row, width)} if place else {}
        way = np.diff(row.counts)
        now: dict[int, list[tuple[float, float, float, float]]] = {}
        for j, (x, frequency) in enumerate(zip(row.at, row.frequency, strict=True)):
            chain = open_.pop(linked[j], None) if j in linked else None
            chain = [] if chain is None else chain
            chain.append((float(x), y, float(frequency), float(np.sign(way[j]))))
            now[j] = chain
        done += open_.values()
        open_ = now
    return [_curve(np.array(chain)) for chain in [*done, *open_.values()] if len(chain) > 1]


def _curve(points: Array) -> CrossingCurve:
    """The curve through (x, y, frequency, way): towards at right angles to it, with x where more become unstable."""
    x, y, frequency, way = points.T
    lean = np.gradient(x, y)
    return CrossingCurve(x, y, frequency, np.stack([way, -way * lean], axis=1))
