"""The two exact steps of a sampled loop: the flow between ticks and the jump at a tick."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import pairwise
from math import ceil, floor, lcm
from typing import final

import numpy as np
from scipy.linalg import expm, matrix_balance

from delaytools.linear.lifted_paths import Expansion
from delaytools.linear.matrices import RealMatrix, joined_diagonally
from delaytools.linear.sampled_system import SampledSystem
from delaytools.signals.trouble import AnalysisError

__all__ = ["MERGE", "Clock", "Layout", "clock_of", "flow", "jump", "layout_of"]

MERGE = 1e-9  # instants closer than this part of the shortest period are one instant
MOST_TICKS = 1000


@final
@dataclass(frozen=True)
class Clock:
    """The periods of the held signals and the hyper-period after which all ticks repeat, in seconds."""

    periods: tuple[float, ...]
    hyper_period: float
    merge: float

    def latest(self, held: int, time: float) -> int:
        """The number of the tick of `held` whose value stands at `time` (a tick counts from its instant)."""
        return floor((time + self.merge) / self.periods[held])

    def ticks(self, period: float, time: float) -> bool:
        """Whether a clock of `period` ticks at `time`."""
        return abs(time - round(time / period) * period) <= self.merge


def clock_of(periods: Sequence[float]) -> Clock | None:
    """The clock of commensurate periods; None where 1000 ticks of the fastest do not bring all together."""
    shortest = min(periods)
    ratios = [Fraction(period / shortest).limit_denominator(MOST_TICKS) for period in periods]
    if any(abs(float(r) * shortest - p) > MERGE * shortest for r, p in zip(ratios, periods, strict=True)):
        return None
    shared = reduce(lcm, (ratio.denominator for ratio in ratios))
    ticks = Fraction(reduce(lcm, (int(ratio * shared) for ratio in ratios)), shared)
    if ticks > MOST_TICKS:
        return None
    return Clock(tuple(periods), float(ticks) * shortest, MERGE * shortest)


@final
@dataclass(frozen=True, eq=False)
class Layout:
    """Where everything stands in the discrete state [copies X; sampler states ζ; held values, newest first].

    slots[h] is the place of the newest value of held signal h; older ones follow. F, G, H, D: the samplers
    side by side, over all ζ, q and v; state_periods: the period of each ζ.
    """

    expansion: Expansion
    clock: Clock
    slots: tuple[int, ...]
    size: int
    state_periods: tuple[float, ...]
    F: RealMatrix
    G: RealMatrix
    H: RealMatrix
    D: RealMatrix

    @property
    def n_sampled(self) -> int:
        """The number of held signals that samplers write; the others are given inputs."""
        return int(self.D.shape[0])

    @property
    def sampler_states(self) -> slice:
        """Where the states kept by the samplers stand."""
        first = len(self.expansion.copies)
        return slice(first, first + len(self.state_periods))

    def places(self, newest: float, time: float) -> list[int]:
        """Where each lagged held signal at `time` stands in a state whose newest values are those of `newest`."""
        latest = self.clock.latest
        ages = [latest(h, newest) - latest(h, time - lag) for h, lag in self.expansion.held]
        return [self.slots[h] + max(0, age) for (h, _), age in zip(self.expansion.held, ages, strict=True)]


def layout_of(sampled: SampledSystem, expansion: Expansion, clock: Clock) -> Layout:
    """The discrete state of `expansion`: as many past values of each held signal as its longest lag needs."""
    state_periods = tuple(s.period for s in sampled.samplers for _ in range(s.n_states))
    size = len(expansion.copies) + len(state_periods)
    slots = []
    for h, period in enumerate(clock.periods):
        slots.append(size)
        longest = max((lag for other, lag in expansion.held if other == h), default=0.0)
        size += 1 + max(0, ceil((longest - clock.merge) / period))
    empty = np.zeros((0, 0))
    parts = [
        reduce(joined_diagonally, (getattr(sampler, name) for sampler in sampled.samplers), empty)
        for name in ("F", "G", "H", "D")
    ]
    return Layout(expansion, clock, tuple(slots), size, state_periods, *parts)


def flow(layout: Layout, start: float, duration: float) -> RealMatrix:
    """The map of the discrete state over [start, start + duration] without ticks, past arrivals included.

    X(t + h) = e^{A h} X(t) + ∫ e^{A s} ds B u between arrivals of lagged held values; exact.
    """
    instants = _arrivals(layout, start, duration)
    total = np.eye(layout.size)
    n = len(layout.expansion.copies)
    for first, last in pairwise(instants):
        transition, driven = _held_response(layout.expansion, last - first)
        step = np.eye(layout.size)
        step[:n, :n] = transition
        for column, place in enumerate(layout.places(start, 0.5 * (first + last))):
            step[:n, place] += driven[:, column]
        total = step @ total
    return total


def _arrivals(layout: Layout, start: float, duration: float) -> list[float]:
    clock, end = layout.clock, start + duration
    instants = []
    for h, lag in layout.expansion.held:
        period = clock.periods[h]
        first = ceil((start - lag - clock.merge) / period)
        last = floor((end - lag + clock.merge) / period)
        instants += [k * period + lag for k in range(first, last + 1)]
    inside = sorted(t for t in instants if start + clock.merge < t < end - clock.merge)
    merged = [start]
    for instant in inside:
        if instant - merged[-1] > clock.merge:
            merged.append(instant)
    return [*merged, end]


def _held_response(expansion: Expansion, duration: float) -> tuple[RealMatrix, RealMatrix]:
    n, m = expansion.B.shape
    joined = np.zeros((n + m, n + m))
    joined[:n, :n], joined[:n, n:] = expansion.A * duration, expansion.B * duration
    balanced, (scale, _) = matrix_balance(joined, permute=False, separate=True)
    power = scale[:, None] * expm(balanced) / scale  # powers of 2: nothing is lost, and small states keep their digits
    return power[:n, :n], power[:n, n:]


def jump(layout: Layout, time: float) -> tuple[RealMatrix, RealMatrix]:
    """The maps (from the discrete state just before, from the held inputs) to the state just after a tick.

    v = H ζ + D q;  ζ⁺ = F ζ + G q;  all samplers that tick at `time` together, new values read at once.
    Raises AnalysisError where sampled blocks read each other's new values in a circle.
    """
    ticking = np.array([layout.clock.ticks(period, time) for period in layout.clock.periods])
    reading, fresh, given = _readings(layout, time, ticking)
    sampled = np.flatnonzero(ticking[: layout.n_sampled])
    states = np.zeros((layout.F.shape[0], layout.size))
    states[:, layout.sampler_states] = np.eye(layout.F.shape[0])
    wide, D = np.hstack([reading, given]), layout.D[sampled]
    direct = D @ fresh[:, sampled]
    _refuse_circle(direct)
    held = np.hstack([layout.H[sampled] @ states, np.zeros((len(sampled), given.shape[1]))]) + D @ wide
    new = np.asarray(np.linalg.solve(np.eye(len(sampled)) - direct, held), dtype=float)
    after = _shifted(layout, ticking, new)
    stepped = layout.F @ states @ np.eye(*after.shape) + layout.G @ (wide + fresh[:, sampled] @ new)
    for i, period in enumerate(layout.state_periods):
        if layout.clock.ticks(period, time):
            after[layout.sampler_states.start + i] = stepped[i]
    return after[:, : layout.size], after[:, layout.size :]


def _readings(layout: Layout, time: float, ticking: np.ndarray) -> tuple[RealMatrix, RealMatrix, RealMatrix]:
    """q over (the shifted-out old state, the new v, the new held inputs)."""
    expansion, n = layout.expansion, len(layout.expansion.copies)
    reading = np.zeros((expansion.Cq.shape[0], layout.size))
    reading[:, :n] = expansion.Cq
    new = np.zeros((expansion.Cq.shape[0], len(layout.slots)))
    for (h, _), place, column in zip(expansion.held, layout.places(time, time), expansion.Dq.T, strict=True):
        if ticking[h] and place == layout.slots[h]:
            new[:, h] += column
        else:
            reading[:, place - int(ticking[h])] += column
    return reading, new[:, : layout.n_sampled], new[:, layout.n_sampled :]


def _refuse_circle(direct: RealMatrix) -> None:
    reach = np.eye(len(direct), dtype=int)
    for _ in range(len(direct)):
        reach = np.minimum(reach @ (direct != 0).astype(int), 1)
    if reach.any():
        raise AnalysisError(
            "sampled blocks read each other's new values in a circle (an algebraic loop)",
            advice="put dynamics, a delay or a state into that loop",
        )


def _shifted(layout: Layout, ticking: np.ndarray, new: RealMatrix) -> RealMatrix:
    """The state after the tick: copies stay, held values move one place on and the new ones stand first."""
    size, n_sampled = layout.size, layout.n_sampled
    before = np.eye(size, size + len(layout.slots) - n_sampled)
    after = before.copy()
    written = iter(new)
    for h, end in enumerate([*layout.slots[1:], size]):
        slot = layout.slots[h]
        if ticking[h]:
            after[slot + 1 : end] = before[slot : end - 1]
            after[slot] = next(written) if h < n_sampled else np.eye(after.shape[1])[size + h - n_sampled]
    return after
