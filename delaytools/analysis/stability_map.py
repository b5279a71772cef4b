"""Stability in the plane of two parameters: the curves on which roots lie on the axis, and a count in between."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.crossings import gain_crossings
from delaytools.analysis.delay_sweep import delay_windows
from delaytools.analysis.map_curves import CrossingCurve, Span, delay_curves, factor_curves
from delaytools.analysis.margins import curve_of
from delaytools.linear.algebra import delay
from delaytools.linear.delay_system import DelaySystem
from delaytools.signals.trouble import AnalysisError

__all__ = ["POINTS", "StabilityMap", "checked", "delay_factor_map", "two_delay_map"]

Array = NDArray[np.float64]
LINE = 12  # points of a straight line
POINTS = (401, 61)  # of the grid on which roots are counted: along a row they cost nothing


@final
@dataclass(frozen=True, eq=False)
class StabilityMap:
    """A plane of two parameters, x and y: what they are, and their ranges.

    curves: exact. grid_x (nx,), grid_y (ny,); counts (ny, nx): roots with Re s > 0 there, inf where a chain of them
    has no end.
    """

    names: tuple[str, str]
    spans: tuple[Span, Span]
    curves: tuple[CrossingCurve, ...]
    grid_x: Array
    grid_y: Array
    counts: Array
    sampling: str = "exact"
    linearised_without: tuple[str, ...] = field(default=())

    @property
    def stable_share(self) -> float:
        """The share of the plane in which the loop is stable, as the grid sees it."""
        return float(np.mean(self.counts == 0))


def delay_factor_map(
    opened: DelaySystem, delays: Span, factors: Span, points: tuple[int, int] = POINTS
) -> StabilityMap:
    """Stability over a delay (s, x) and a factor > 0 (y); opened: what enters the two places over what leaves them.

    opened (2, 2): P in w₁ = e^{-sτ} z₁, w₂ = k z₂, z = P w. Raises AnalysisError for a range that is none.
    """
    checked(delays, factors)
    if factors[0] <= 0:
        raise AnalysisError("a factor is above 0", found=f"{factors[0]:g}")
    x, y = (np.linspace(*span, n) for span, n in zip((delays, factors), points, strict=True))
    loops = [_around_first(opened, np.array([[float(k)]])) for k in y]
    curves = tuple(factor_curves(opened, (delays, factors), _net(opened, loops[-1], delays)))
    return StabilityMap(("delay", "gain"), (delays, factors), curves, x, y, _counted(loops, x))


def two_delay_map(
    opened: DelaySystem, first: Span, second: Span, points: tuple[int, int] = POINTS
) -> StabilityMap:
    """Stability over two delays (s); opened as in `delay_factor_map`, with w₂ = e^{-sτ₂} z₂."""
    checked(first, second)
    if second[0] < 0:
        raise AnalysisError("a delay is not negative", found=f"{second[0]:g} s")
    x, y = (np.linspace(*span, n) for span, n in zip((first, second), points, strict=True))
    loops = [_around_first(opened, delay(float(tau))) for tau in y]
    net = _net(opened, loops[0], first)
    own = opened.frequency_response(net)
    if own[:, 0, 0].any() or own[:, 1, 1].any():
        curves = tuple(delay_curves(opened, (first, second), net))
    else:
        curves = tuple(_in_series(_around_first(opened, delay(0.0)), first, second))
    return StabilityMap(("delay", "delay"), (first, second), curves, x, y, _counted(loops, x))


def _in_series(L: DelaySystem, first: Span, second: Span) -> Iterator[CrossingCurve]:
    """Of two delays that are passed one after the other only the sum counts: straight lines."""
    crossings = gain_crossings(curve_of(L))
    for omega, value, falling in zip(crossings.omega, crossings.value, crossings.falling, strict=True):
        sums = (np.pi + np.angle(value)) / omega + 2 * np.pi / omega * np.arange(first[1] * omega + second[1] * omega)
        for total in sums[(sums > first[0] + second[0]) & (sums < first[1] + second[1])]:
            ends = max(first[0], total - second[1]), min(first[1], total - second[0])
            x = np.linspace(*ends, LINE)
            towards = np.full((LINE, 2), float(np.sign(falling)))
            yield CrossingCurve(x, total - x, np.full(LINE, omega), towards)


def checked(delays: Span, others: Span) -> None:
    """Raises AnalysisError for a range that does not rise, or of no delay."""
    for low, high in (delays, others):
        if not (np.isfinite([low, high]).all() and low < high):
            raise AnalysisError("a range rises", found=f"from {low:g} to {high:g}")
    if delays[0] < 0:
        raise AnalysisError("a delay is not negative", found=f"{delays[0]:g} s")


def _around_first(opened: DelaySystem, second: DelaySystem | Array) -> DelaySystem:
    """L at the first place with the second one closed by a delay or a factor: the loop is u = -L e^{-sτ} u."""
    end = np.array([[1.0], [0.0]])
    if isinstance(second, np.ndarray):
        return -opened.connected(np.diag([0.0, float(second[0, 0])]), into=end, out=end.T)
    both = opened.appended(second)
    wires = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    into = np.vstack([end, [[0.0]]])
    return -both.connected(wires, into=into, out=into.T).without_zero_delays()


def _net(opened: DelaySystem, around: DelaySystem, delays: Span) -> Array:
    """Frequencies between which neither the places nor the loop around the first bend much."""
    nets = [curve_of(around, np.array([delays[1]])).omega]
    own = opened.frequency_response(nets[0])
    nets += [curve_of(opened[k, k]).omega for k in (0, 1) if own[:, k, k].any()]
    return np.unique(np.concatenate(nets))


def _counted(loops: Sequence[DelaySystem], delays: Array) -> Array:
    """(loops, delays): roots of 1 + L(s) e^{-sτ} = 0 with Re s > 0, exact but on a crossing itself."""
    rows = []
    for L in loops:
        if curve_of(L).features.ceiling >= 1:  # every delay but none lets a chain without end into Re s > 0
            rows.append(np.where(delays > 0, np.inf, float(delay_windows(L, 0.0).first)))
        else:
            rows.append(delay_windows(L, float(delays.max())).unstable_counts(delays).astype(float))
    return np.stack(rows)
