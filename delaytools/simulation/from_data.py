"""A call for a loop whose grid does not repeat: varying delays, jumps beside the frames, odd rates.

Where each delay looks back to, and where the grid is uneven also the spans' lengths and the ticks, are data.
"""

from dataclasses import replace
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.simulation.physics import Physics
from delaytools.simulation.schedule import Grid, Lookup, Timing, hyper_period, look_back, run_grid
from delaytools.simulation.unroll import (
    Call,
    Inputs,
    Plan,
    Stepper,
    Walk,
    cubic,
    own_parts,
    state_size,
    walk_spans,
)

__all__ = ["data_call", "moved_data"]

LARGEST_CALL = 20  # spans
STAGES = 3


def data_call(model: Physics, timing: Timing, end: float, *, short: bool = False) -> Call:
    """The unrolled function of some spans and the data of every call up to `end` s; short: of one span."""
    grid = run_grid(timing, end)
    lookups = tuple(look_back(grid, delay) for delay in timing.delays)
    return _FromData(model, timing, grid, lookups, 1 if short else LARGEST_CALL).build()


def moved_data(call: Call, model: Physics, timing: Timing, end: float) -> Call | None:
    """The call for other values of its delays, or None where these need other spans or a longer history."""
    grid = run_grid(timing, end)
    lookups = tuple(look_back(grid, delay) for delay in timing.delays)
    return _FromData(model, timing, grid, lookups, call.spans).instead_of(call)


@final
class _FromData:
    """Builds the call: an inner function on gathered pieces of history, and the gathering around it."""

    def __init__(self, model: Physics, timing: Timing, grid: Grid, lookups: tuple[Lookup, ...], most: int) -> None:
        self.model, self.timing, self.grid, self.lookups = model, timing, grid, lookups
        self.even = bool(np.ptp(grid.length) < 1e-12 * timing.frame + 1e-9 * grid.length[0])
        self.delays = len(lookups)
        nearest = min((int(look.back.min()) for look in lookups), default=most)
        self.inside = nearest == 0
        self.period = self._tick_period()
        self.spans = self._spans(nearest, most)
        self.ticks_known = self.period is not None and self.spans % self.period == 0
        self.depth = max((int(look.back.max()) for look in lookups), default=1)
        self.names = tuple(timing.periods)
        self.per_span = (
            3 * STAGES * self.delays + (0 if self.even else 1) + (0 if self.ticks_known else len(self.names))
        )

    def _tick_period(self) -> int | None:
        frames = hyper_period(self.timing.frame, list(self.timing.periods.values()))
        return None if frames is None or not self.even else frames * self.timing.substeps

    def _spans(self, nearest: int, most: int) -> int:
        most = max(1, min(most, nearest))
        if self.period is None or self.period > most:
            return most
        return most // self.period * self.period

    def build(self) -> Call:
        """The call and its data."""
        inputs = Inputs(self.model, self.spans, self.spans * (self.per_span + 4 * STAGES * self.delays))
        inner = self._inner(inputs)
        own = state_size(self.model, 0)
        state = ca.MX.sym("state", own + 4 * self.depth * self.delays)
        data = ca.MX.sym("data", inputs.width)
        p = ca.MX.sym("p", len(self.model.free))
        small, history = state[:own], state[own:]
        front = inputs.width - self.spans * 4 * STAGES * self.delays
        pieces = history[data[front:]] if self.delays else ca.MX(0, 1)
        new, made, rows = inner(small, pieces, data[:front], p)
        kept = []
        for delay in range(self.delays):
            part = history[4 * self.depth * delay : 4 * self.depth * (delay + 1)]
            added = made[4 * self.spans * delay : 4 * self.spans * (delay + 1)]
            kept.append(ca.vertcat(part, added)[4 * self.spans :])
        function = ca.Function("call", [state, data, p], [ca.vertcat(new, *kept), rows])
        if not self.delays:
            function = function.expand()
        call = Call(function, inputs, self.spans, self.spans, self.depth, self.grid, 0, self._data())
        call.once("shape", self._shape)
        return call

    def instead_of(self, call: Call) -> Call | None:
        """A call with the data of this one, where its function fits them."""
        if call.made["shape"] != self._shape() or self.spans != call.spans or self.depth > call.depth:
            return None
        self.depth = call.depth
        return replace(call, grid=self.grid, data=self._data())

    def _shape(self) -> tuple[Any, ...]:
        length = round(float(self.grid.length[0]), 15) if self.even else 0.0
        return self.inside, self.ticks_known, self.per_span, length

    def _inner(self, inputs: Inputs) -> ca.Function:
        own = state_size(self.model, 0)
        small = ca.SX.sym("small", own)
        pieces = ca.SX.sym("pieces", 4 * STAGES * self.delays * self.spans)
        data = ca.SX.sym("data", inputs.width - pieces.shape[0])
        walk = self._walk(small)
        begin = self.spans * inputs.per_span

        between = cubic()

        def number(i: int, k: int) -> Any:
            return data[begin + i * self.per_span + k]

        def look(i: int, delay: int, stage: int, history: list[Any]) -> tuple[Any, Any]:
            slot = delay * STAGES + stage
            at = 4 * (i * STAGES * self.delays + slot)
            piece = pieces[at : at + 4]
            if self.inside and stage > 0:
                piece = ca.if_else(number(i, 3 * slot + 2), history[-1], piece)
            value, slope = between(piece, number(i, 3 * slot))
            return value, slope * number(i, 3 * slot + 1)

        plan = Plan(
            length=lambda i: float(self.grid.length[0]) if self.even else number(i, 9 * self.delays),
            ticking=lambda i: self._ticking(i, number),
            look=look,
            looks_inside=lambda i: self.inside,
            row=lambda i: True,
            time=lambda i: inputs.time(data, i),
        )
        walk_spans(
            Stepper(self.model, self.model.symbol), walk, plan, lambda i: inputs.external(data, i), self.spans
        )
        made = [piece for history in walk.history for piece in history]
        new = ca.vertcat(walk.x, walk.v, walk.k, walk.w)
        outputs = [new, ca.vertcat(*made) if made else ca.SX(0, 1), ca.vertcat(*walk.rows)]
        return ca.Function("inner", [small, pieces, data, self.model.symbol], outputs)

    def _walk(self, small: ca.SX) -> Walk:
        parts, _ = own_parts(self.model, small)
        return Walk(*parts, [[] for _ in self.model.layout.transports], [])

    def _ticking(self, i: int, number: Any) -> dict[str, Any]:
        if not self.ticks_known:
            at = 9 * self.delays + (0 if self.even else 1)
            return {name: number(i, at + k) for k, name in enumerate(self.names)}
        return {name: 1 for name in self.names if _ticks(self.grid.start[i], self.timing.periods[name])}

    def _data(self) -> NDArray[np.float64]:
        """(calls, extra): look-ups, lengths, ticks, then positions in the history."""
        n = len(self.grid.start)
        calls = -(-n // self.spans)
        columns: list[NDArray[np.float64]] = []
        places: list[NDArray[np.float64]] = []
        inner = np.arange(n) % self.spans
        for delay, look in enumerate(self.lookups):
            for stage in range(STAGES):
                back = look.back[:, stage]
                columns += [look.theta[:, stage], look.slope[:, stage], (back == 0).astype(float)]
                at = 4 * (delay * self.depth + np.clip(self.depth + inner - back, 0, self.depth - 1))
                places += [at + m for m in range(4)]
        if not self.even:
            columns.append(self.grid.length)
        if not self.ticks_known:
            columns += [
                _ticks(self.grid.start, period).astype(float) for period in self.timing.periods.values()
            ]
        return np.hstack([_per_call(columns, calls, self.spans), _per_call(places, calls, self.spans)])


def _ticks(start: Any, period: float) -> Any:
    phase = np.asarray(start) / period
    return np.abs(phase - np.round(phase)) * period < 1e-9 * period


def _per_call(columns: list[NDArray[np.float64]], calls: int, spans: int) -> NDArray[np.float64]:
    if not columns:
        return np.zeros((calls, 0))
    table = np.stack(columns, axis=1).astype(float)
    padded = np.vstack([table, np.repeat(table[-1:], calls * spans - len(table), axis=0)])
    return padded.reshape(calls, -1)
