"""What an effect changes in its wire: the signal behind it less the one before it, row by row, without a run.

Between rows the change counts as a broken line, or as a staircase where the signal is held (the mean from each row to
the next), which the effect's own change need not be.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from delaytools.blocks.block import Block, Continuous, Follower, Sampled, flat_values, with_values
from delaytools.blocks.delay import Delay
from delaytools.blocks.flexible_mode import FlexibleMode
from delaytools.blocks.lag import Lag
from delaytools.blocks.rate_limiter import RateLimiter
from delaytools.blocks.sample_hold import SampleHold
from delaytools.diagnosis.views import View
from delaytools.loop.loop import Element
from delaytools.loop.port import Port
from delaytools.loop.values import resolve

__all__ = ["change_at"]

Array = NDArray[np.float64]
CHUNK = 500  # rows: making a longer chain of calls costs more than calling a short one often


@final
@dataclass(frozen=True, eq=False)
class _Wire:
    """Where an effect stands: rows (s), the signal before them; whether it is held, whether it is measured, and whether
    a tick reads it; whether what shakes a mode there is held."""

    time: Array
    before: float
    held: bool
    shown: bool
    read: bool
    source_held: bool

    @property
    def step(self) -> float:
        """Time between rows, s."""
        return float(self.time[-1] - self.time[0]) / max(len(self.time) - 1, 1)


def change_at(view: View, port: Port, element: Element) -> tuple[Array, ...] | None:
    """Per log (n,) what the effect changes at its port; None for what has no rule.

    Where the signal is held: the mean from each row to the next. Elsewhere: the value at each row; what jumps within
    the segment is there the broken line about it.
    """
    found = []
    read = port.kind == "input" and isinstance(resolve(view.loop)[port.element].block, Sampled)
    for log, u in enumerate(view.at(port)):
        time = view.case.records[log].time - view.case.records[log].time[0]
        more = tuple(view.evaluated(element.inputs[name], log) for name in element.block.inputs[1:])
        shown, shaken = view.is_exit(port), element.inputs.get("source")
        source_held = shaken is not None and view.are_held(shaken.names)
        wire = _Wire(time, view.before(port, log), view.is_held(port), shown, read, source_held)
        rows = _passed(element.block, (u, *more), wire)
        if rows is None:
            return None
        found.append(rows - u)
    return tuple(found)


def _passed(block: Block, inputs: tuple[Array, ...], wire: _Wire) -> Array | None:
    u, step = inputs[0], wire.step
    match block:
        case Continuous(states=()):
            return _mapped(block, wire.time, inputs)
        case FlexibleMode():
            rows = _rung(block, inputs[1], wire)
            return u + (_to_next(rows) if wire.held and not (wire.shown or wire.read) else rows)
        case Lag(time_constant=lag) if lag > 0:
            return _lagged(u, float(lag), step, wire.held)
        case Delay(delay=delay):
            return _late(u, float(delay), wire)
        case SampleHold(period=period):
            rows = u[np.searchsorted(wire.time, np.floor(wire.time / period + 1e-9) * period - 1e-9)]
            return rows if wire.held or wire.shown else _centred(rows)
        case RateLimiter():
            driven = np.concatenate([[wire.before], u[:-1]]) if wire.held else u
            rows = _followed(block, driven, (wire.before, step))
            return _to_next(rows) if wire.held else rows
        case Follower():
            return _followed(block, u, (wire.before, step))
    return None


def _mapped(block: Continuous, time: Array, inputs: tuple[Array, ...]) -> Array:
    """The block's own formula on all rows at once."""
    numbers = flat_values(block)
    values = np.array([float(number) for number in numbers.values()])
    structure = _Structure(type(block), tuple(numbers), block.inputs, repr(getattr(block, "formula", None)), block)
    formula = _formula(structure, len(time))
    buffer, evaluate = formula.buffer()
    found = np.empty(len(time))
    for place, rows in enumerate((values, time, *inputs)):
        if rows.size:
            buffer.set_arg(place, memoryview(np.ascontiguousarray(rows, dtype=float)))
    buffer.set_res(0, memoryview(found))
    evaluate()
    return found


@final
@dataclass(frozen=True)
class _Structure:
    """What a block's formula depends on besides the numbers of its values, and one block of that kind."""

    kind: type
    names: tuple[str, ...]
    inputs: tuple[str, ...]
    formula: str
    block: Continuous = field(compare=False)


@lru_cache(maxsize=128)
def _formula(structure: _Structure, rows: int) -> ca.Function:
    """(values, time, inputs) -> output of the block, for so many rows; the values are the same for all."""
    values = ca.MX.sym("values", len(structure.names))
    t, u = ca.MX.sym("t", rows), [ca.MX.sym(name, rows) for name in structure.block.inputs]
    symbols = ca.vertsplit(values) if structure.names else []
    block = with_values(structure.block, dict(zip(structure.names, symbols, strict=True)))
    found = ca.MX(block.output(t, [], u)[0])
    whole = found if found.shape[0] == rows else ca.repmat(found, rows, 1)
    return ca.Function("rows", [values, t, *u], [ca.densify(whole)])


def _followed(block: Follower, u: Array, past: tuple[float, float]) -> Array:
    """The block's own formula from row to row."""
    before, step = past
    memory, x = ca.SX.sym("memory"), ca.SX.sym("u")
    formula = ca.Function("follow", [memory, x], [block.follow(memory, x, step)])
    many = formula.mapaccum(CHUNK)
    rows, last = np.empty((-(-len(u) // CHUNK), CHUNK)), before if block.start is None else block.start
    padded = np.concatenate([u, np.full(rows.size - len(u), u[-1])]).reshape(rows.shape)
    buffer, evaluate = many.buffer()
    for driven, made in zip(padded, rows, strict=True):
        buffer.set_arg(0, memoryview(np.array([last], dtype=float)))
        buffer.set_arg(1, memoryview(driven))
        buffer.set_res(0, memoryview(made))
        evaluate()
        last = made[-1]
    return rows.ravel()[: len(u)]


def _lagged(u: Array, lag: float, step: float, held: bool) -> Array:
    """The lag from 0, exactly for a staircase or a broken line."""
    keep = np.exp(-step / lag)
    if held:
        rows = np.asarray(lfilter([0.0, 1 - keep], [1.0, -keep], u))
        return np.asarray(u + (rows - u) * lag / step * (1 - keep))
    ramp = 1 - lag / step * (1 - keep)
    rows = lfilter([ramp, 1 - keep - ramp], [1.0, -keep], u)
    return np.asarray(rows - ramp * u[0] * keep ** np.arange(len(u)))


def _rung(block: FlexibleMode, source: Array, wire: _Wire) -> Array:
    """What a mode adds at the rows, shaken from rest by a staircase or a broken line, exactly."""
    frequency = 2 * np.pi * float(block.frequency)
    answer = [frequency * float(block.gain), 0.0], [1.0, 2 * float(block.damping) * frequency, frequency**2]
    first, rest = np.full(len(source), source[0]), source - source[0]
    parts = [(source, "zoh")] if wire.source_held else [(first, "zoh"), (rest, "foh")]
    found = np.zeros(len(source))
    for rows, hold in parts:
        over, under, _ = cont2discrete(answer, wire.step, hold)
        found += lfilter(np.ravel(over), under, rows)
    return found


def _late(u: Array, delay: float, wire: _Wire) -> Array:
    if not wire.held:
        return np.asarray(np.interp(wire.time - delay, wire.time, u))
    rows = delay / wire.step
    whole, part = int(rows), rows - int(rows)
    ahead, behind = (np.concatenate([np.full(k, wire.before), u])[: len(u)] for k in (whole, whole + 1))
    return np.asarray((1 - part) * ahead + part * behind)


def _centred(rows: Array) -> Array:
    """A staircase as the broken line with the same area about every row."""
    return 0.5 * (rows + np.concatenate([rows[:1], rows[:-1]]))


def _to_next(rows: Array) -> Array:
    """The mean from each row to the next."""
    return 0.5 * (rows + np.concatenate([rows[1:], rows[-1:]]))
