"""A call for a loop whose grid repeats: constant delays and ticks that meet again after some frames."""

import math
from dataclasses import replace
from typing import Any, final

import casadi as ca
import numpy as np

from delaytools.simulation.physics import Physics
from delaytools.simulation.schedule import Grid, Lookup, Timing, hyper_period, look_back, run_grid
from delaytools.simulation.unroll import (
    Call,
    Inputs,
    Plan,
    Stepper,
    hermite,
    join_state,
    split_state,
    state_size,
    walk_spans,
    weights,
)

__all__ = ["moved_repeating", "repeating_call"]

SMALLEST_CALL = 15  # spans


def repeating_call(model: Physics, timing: Timing, *, short: bool = False) -> Call | None:
    """The unrolled function of one or more hyper-periods, or None where the grid does not repeat.

    short: of one hyper-period only.
    """
    frames = hyper_period(timing.frame, list(timing.periods.values()))
    if timing.varying or timing.by_frame is not None or frames is None:
        return None
    pattern = _pattern(timing, frames)
    if pattern is None:
        return None
    grid, lookups, moved = pattern
    count = len(grid.start)
    copies = 1 if short else max(1, math.ceil(SMALLEST_CALL / count))
    depth = max((int(look.back.max()) for look in lookups), default=0)
    builder = _Repeating(model, timing, grid, lookups, moved)
    return builder.build(copies, depth)


def moved_repeating(call: Call, timing: Timing) -> Call | None:
    """The call for other values of its free delays, or None where these meet or look at other spans."""
    frames = hyper_period(timing.frame, list(timing.periods.values()))
    pattern = None if timing.varying or frames is None else _pattern(timing, frames)
    if pattern is None:
        return None
    grid, lookups, _ = pattern
    if not np.array_equal(grid.moved, call.grid.moved) or not np.array_equal(grid.row, call.grid.row):
        return None
    if not all(np.array_equal(new.back, old.back) for new, old in zip(lookups, call.lookups, strict=True)):
        return None
    return replace(call, grid=grid, lookups=lookups)


def _pattern(timing: Timing, frames: int) -> tuple[Grid, tuple[Lookup, ...], Any] | None:
    """One hyper-period in the steady state; None where a single jump falls beside its grid."""
    length = frames * timing.frame
    reach = max((tau for tau in timing.constant), default=0.0) * (
        1 + max((len(a.through) for a in timing.arrivals), default=0)
    )
    early = math.ceil(reach / length + 1e-9) + 1
    ticking = Timing(
        timing.frame,
        timing.periods,
        timing.delays,
        timing.constant,
        tuple(a for a in timing.arrivals if a.source in timing.periods),
        {},
        timing.substeps,
    )
    grid = run_grid(ticking, (early + 2) * length)
    lookups = tuple(look_back(grid, delay) for delay in timing.delays)
    begin = int(np.searchsorted(grid.start, early * length - 1e-9 * timing.frame))
    end = int(np.searchsorted(grid.start, (early + 1) * length - 1e-9 * timing.frame))
    if not _on_grid(timing, grid.start[begin : end + 1] - grid.start[begin], length):
        return None
    part = slice(begin, end)
    one = Grid(
        grid.start[part] - grid.start[begin], grid.length[part], grid.row[part], grid.moved[begin : end + 1]
    )
    cut = tuple(Lookup(look.back[part], look.theta[part], look.slope[part]) for look in lookups)
    return one, cut, (grid, begin)


def _on_grid(timing: Timing, edges: Any, length: float) -> bool:
    """Whether single jumps, and where they arrive, all fall on the repeating grid."""
    times = [timing.jumps[name] for name in timing.jumps]
    for arrival in timing.arrivals:
        if arrival.source in timing.jumps:
            times.append(timing.jumps[arrival.source] + sum(timing.constant[i] for i in arrival.through))
    for group in times:
        place = np.mod(group, length)
        gap = np.min(np.abs(place[:, None] - np.append(edges, length)[None, :]), axis=1, initial=np.inf)
        if np.any(gap > 1e-9 * timing.frame):
            return False
    return True


@final
class _Repeating:
    """Builds the call; with free delays its lengths and look-ups stay formulas of them."""

    def __init__(
        self, model: Physics, timing: Timing, grid: Grid, lookups: tuple[Lookup, ...], whole: Any
    ) -> None:
        self.model, self.timing, self.grid, self.lookups = model, timing, grid, lookups
        self.whole, self.begin = whole
        self.p = model.symbol
        self.shift = self._delay_shift()
        self.is_moved = not all(isinstance(shift, float) for shift in self.shift)
        self._weights: dict[tuple[int, int, int], tuple[Any, Any]] = {}
        self.ticks = _ticks(timing, grid)

    def _delay_shift(self) -> list[Any]:
        """τ(p) - τ at the grid, per delay: 0.0 where no free value moves it."""
        shifts: list[Any] = []
        for name, nominal in zip(self.model.layout.transports, self.timing.constant, strict=True):
            seconds = ca.SX(self.model.net.elements[name].block.seconds(0.0, []))
            if seconds.is_constant():
                shifts.append(0.0)
                continue
            shifts.append(seconds - nominal)
        return shifts

    def _edge(self, absolute: int) -> Any:
        """Where a boundary of the whole grid lies, in s, as the free delays move it."""
        at = float(self.whole.start[absolute]) if absolute < len(self.whole.start) else None
        if at is None:
            at = float(self.whole.start[-1] + self.whole.length[-1])
        for delay, share in enumerate(self.whole.moved[absolute]):
            if share and not isinstance(self.shift[delay], float):
                at = at + float(share) * self.shift[delay]
        return at

    def length(self, i: int) -> Any:
        """h of span i, in s."""
        index = i % len(self.grid.start)
        if not self.is_moved:
            return float(self.grid.length[index])
        return self._edge(self.begin + index + 1) - self._edge(self.begin + index)

    def look(self, i: int, delay: int, stage: int, pieces: list[Any]) -> tuple[Any, Any]:
        """Value and scaled derivative of what leaves a delay at a stage."""
        index, look = i % len(self.grid.start), self.lookups[delay]
        back, theta = int(look.back[index, stage]), float(look.theta[index, stage])
        piece = pieces[self.depth + i - back]
        if self.is_moved:
            value, slope = self._moved_weights(index, delay, stage)
            return ca.mtimes(value, piece), ca.mtimes(slope, piece)
        theta = round(theta, 12) if min(theta, 1 - theta) > 1e-9 else float(round(theta))
        value, slope = hermite(piece, theta)
        return value, slope * float(look.slope[index, stage])

    def _moved_weights(self, index: int, delay: int, stage: int) -> tuple[Any, Any]:
        """(1, 4) each: of value and scaled derivative, as formulas of the free delays; the same in every copy."""
        key = index, delay, stage
        if key not in self._weights:
            there = self.begin + index - int(self.lookups[delay].back[index, stage])
            length, size = self.length(index), self._edge(there + 1) - self._edge(there)
            t = self._edge(self.begin + index) + (0.0, 0.5, 1.0)[stage] * length
            place = (t - self.timing.constant[delay] - self._edge(there) - self.shift[delay]) / size
            both = weights()(place)
            self._weights[key] = both[0, :], both[1, :] * (length / size)
        return self._weights[key]

    def build(self, copies: int, depth: int) -> Call:
        """The unrolled function of `copies` hyper-periods."""
        count = len(self.grid.start)
        self.depth = depth
        spans = copies * count
        inputs = Inputs(self.model, spans)
        state = ca.SX.sym("state", state_size(self.model, depth))
        data = ca.SX.sym("data", inputs.width)
        walk = split_state(self.model, state, depth)
        plan = Plan(
            length=self.length,
            ticking=lambda i: self.ticks[i % count],
            look=self.look,
            looks_inside=lambda i: any(int(look.back[i % count].min()) == 0 for look in self.lookups),
            row=lambda i: bool(self.grid.row[i % count]),
            time=lambda i: inputs.time(data, i),
        )
        walk_spans(Stepper(self.model, self.p), walk, plan, lambda i: inputs.external(data, i), spans)
        new = join_state(walk, depth)
        function = ca.Function("call", [state, data, self.p], [new, ca.vertcat(*walk.rows)])
        rows = int(sum(self.grid.row)) * copies
        return Call(function, inputs, spans, rows, depth, self.grid, copies, lookups=self.lookups)


def _ticks(timing: Timing, grid: Grid) -> list[dict[str, int]]:
    found: list[dict[str, int]] = []
    for start in grid.start.tolist():
        names = {}
        for name, period in timing.periods.items():
            phase = start / period
            if abs(phase - round(phase)) * period < 1e-9 * timing.frame:
                names[name] = 1
        found.append(names)
    return found
