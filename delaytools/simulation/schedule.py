"""The grid of a run: frames, ticks, arriving jumps, and where each delay looks back to.

All of it is known before the run, because no delay depends on a state. A span is one Runge–Kutta step.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Arrival", "Grid", "Lookup", "Timing", "hyper_period", "look_back", "run_grid", "ticks_between"]

Array = NDArray[np.float64]
STAGES = (0.0, 0.5, 1.0)


@final
@dataclass(frozen=True)
class Arrival:
    """Jumps or kinks that a delay passes on: `times` of the source, sent through the delays in `through`."""

    source: str
    through: tuple[int, ...]


@final
@dataclass(frozen=True)
class Timing:
    """What the grid needs to know of a loop.

    frame: s. periods: sampled element -> s. delays: one function t -> s per transport, and `constant` its value
    where it does not vary (NaN where it does). arrivals: which events pass through which delays sharply enough to
    matter. jumps: external signal or element -> times. substeps: of a frame. by_frame: (frames,) of each frame, where
    they differ.
    """

    frame: float
    periods: dict[str, float]
    delays: tuple[Callable[[Array], Array], ...]
    constant: tuple[float, ...]
    arrivals: tuple[Arrival, ...]
    jumps: dict[str, Array]
    substeps: int
    by_frame: NDArray[np.int64] | None = None

    @property
    def varying(self) -> bool:
        """Whether any delay varies."""
        return any(math.isnan(tau) for tau in self.constant)

    def finer(self, times: int) -> "Timing":
        """The same with so many times more steps."""
        by_frame = None if self.by_frame is None else times * self.by_frame
        return replace(self, substeps=times * self.substeps, by_frame=by_frame)


@final
@dataclass(frozen=True)
class Grid:
    """start, length: (n,) s of each span; row: spans that begin a frame; moved: (n + 1, delays) ∂boundary/∂delay."""

    start: Array
    length: Array
    row: NDArray[np.bool_]
    moved: Array


@final
@dataclass(frozen=True)
class Lookup:
    """Where a delay looks back to, per span and stage: `back` spans ago, at `theta` of that span.

    back, theta, slope: (n, 3); back = 0 is the span itself, slope = (length / length looked at) (1 - τ').
    """

    back: NDArray[np.int64]
    theta: Array
    slope: Array


def hyper_period(frame: float, periods: Sequence[float]) -> int | None:
    """Frames after which all ticks repeat, or None where that is more than 1000 frames."""
    ratio = [Fraction(period / frame).limit_denominator(1000) for period in periods]
    if any(abs(float(r) * frame - p) > 1e-9 * frame for r, p in zip(ratio, periods, strict=True)):
        return None
    frames = 1
    for r in ratio:
        frames = math.lcm(frames, r.numerator)
    return frames if frames <= 1000 else None


def ticks_between(period: float, start: float, end: float) -> Array:
    """Multiples of the period with start <= t < end (to 1e-9 of the period)."""
    first = math.ceil(start / period - 1e-9)
    last = math.ceil(end / period - 1e-9)
    return period * np.arange(first, last)


def _events(timing: Timing, source: str, start: float, end: float) -> Array:
    if source in timing.periods:
        return ticks_between(timing.periods[source], max(start, 0.0), end)
    return timing.jumps.get(source, np.zeros(0))


def _arrive(times: Array, delay: Callable[[Array], Array], end: float) -> Array:
    """Solutions t of t - τ(t) = times, by fixed-point iteration; none where τ' >= 1, which has no one answer."""
    found = times + delay(times)
    for _ in range(60):
        last, found = found, times + delay(found)
        if np.max(np.abs(found - last), initial=0.0) < 1e-14:
            break
    settled = np.abs(found - last) < 1e-12 if len(times) else np.zeros(0, dtype=bool)
    return found[settled & (found <= end)]


def boundaries(timing: Timing, end: float) -> tuple[Array, Array]:
    """Every boundary from 0 to `end`, sorted, and how it moves with each constant delay."""
    count = len(timing.delays)
    frames = timing.frame * np.arange(round(end / timing.frame) + 1)
    times, moved = [frames], [np.zeros((len(frames), count))]
    fixed = [ticks_between(period, 0.0, end) for period in timing.periods.values()]
    fixed += [jumps[(jumps > 0) & (jumps < end)] for jumps in timing.jumps.values()]
    for group in fixed:
        times.append(group)
        moved.append(np.zeros((len(group), count)))
    for arrival in timing.arrivals:
        group = _events(timing, arrival.source, 0.0, end)
        for index in arrival.through:
            group = _arrive(group, timing.delays[index], end)
        group = group[(group > 0) & (group < end)]
        times.append(group)
        row = np.bincount(np.array(arrival.through, dtype=int), minlength=count).astype(float)
        moved.append(np.tile(row, (len(group), 1)))
    return _merged(np.concatenate(times), np.concatenate(moved), timing.frame)


def _merged(times: Array, moved: Array, frame: float) -> tuple[Array, Array]:
    order = np.lexsort((np.abs(moved).sum(axis=1), times))
    times, moved = times[order], moved[order]
    keep = np.diff(times, prepend=-math.inf) > 1e-9 * frame
    return times[keep], moved[keep]


def run_grid(timing: Timing, end: float) -> Grid:
    """The spans of a whole run up to `end` s, what lies between two boundaries cut into `substeps`."""
    edges, moved = boundaries(timing, end)
    frame = (edges[:-1] / timing.frame + 1e-6).astype(np.int64)
    known = np.array([timing.substeps]) if timing.by_frame is None else timing.by_frame
    n = known[np.minimum(frame, len(known) - 1)]
    first = np.repeat(np.arange(len(n)), n)
    part = (np.arange(len(first)) - np.repeat(np.cumsum(n) - n, n)) / n[first]
    start = edges[first] + np.diff(edges)[first] * part
    shift = moved[first] + np.diff(moved, axis=0)[first] * part[:, None]
    start, shift = np.append(start, edges[-1]), np.vstack([shift, moved[-1:]])
    frames = np.abs(start[:-1] / timing.frame - np.round(start[:-1] / timing.frame)) < 1e-9
    return Grid(start[:-1], np.diff(start), frames, shift)


def look_back(grid: Grid, delay: Callable[[Array], Array]) -> Lookup:
    """Where a delay looks back to from every stage of every span.

    At a boundary the span looked at is the one on the same side: a span that begins where a jump arrives sees the
    value after the jump, the span that ends there the value before. Before the first span the first is repeated.
    """
    edges = np.append(grid.start, grid.start[-1] + grid.length[-1])
    n = len(grid.start)
    back = np.zeros((n, 3), dtype=np.int64)
    theta, slope = np.zeros((n, 3)), np.zeros((n, 3))
    usual = np.median(grid.length)
    for stage, part in enumerate(STAGES):
        t = grid.start + part * grid.length
        looked = t - delay(t)
        nudge = (0.5 - part) * 2e-9 * usual
        index = np.minimum(np.searchsorted(edges, looked + nudge, side="right") - 1, np.arange(n))
        inside = np.maximum(index, 0)
        theta[:, stage] = np.where(index < 0, 0.5, (looked - grid.start[inside]) / grid.length[inside])
        early = np.arange(n) + np.maximum(1, np.ceil(-looked / usual)).astype(np.int64)
        back[:, stage] = np.where(index < 0, early, np.arange(n) - index)
        if stage == 0:  # a delay of exactly 0 sees the end of the span before
            theta[:, 0] = np.where(back[:, 0] == 0, 1.0, theta[:, 0])
            back[:, 0] = np.maximum(back[:, 0], 1)
        rate = (delay(t + 1e-6 * usual) - delay(t - 1e-6 * usual)) / (2e-6 * usual)
        slope[:, stage] = grid.length / grid.length[inside] * (1 - rate)
    return Lookup(back, np.clip(theta, 0.0, 1.0), slope)
