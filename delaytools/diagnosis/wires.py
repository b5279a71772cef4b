"""What an effect in a wire does to the exits: what it changes at its port, sent through the rest of the segment.

Where the segment behind the port is linear and the same at all times (checked, not assumed) the change is convolved
with the response to a pulse; elsewhere the one simulation runs with the change put in as a column. Either way the
effect itself need not be compiled into the loop. For starting values: between rows the change is a broken line (a
staircase where the signal is held), which the effect's own change need not be.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.signal import lfilter

from delaytools.blocks.block import Block, Continuous, Follower, Sampled, flat_values, with_values
from delaytools.blocks.delay import Delay
from delaytools.blocks.lag import Lag
from delaytools.blocks.rate_limiter import RateLimiter
from delaytools.blocks.sample_hold import SampleHold
from delaytools.diagnosis.added import Added, path_of, with_added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.pushes import moves_as_measured
from delaytools.diagnosis.views import View
from delaytools.loop.loop import Element, Loop
from delaytools.loop.port import Port, written_at
from delaytools.loop.values import resolve
from delaytools.signals.record import Record
from delaytools.simulation.replay import Replay

__all__ = ["Way", "change_at", "own_way", "way_of"]

Array = NDArray[np.float64]
PROBE = "probe@wire"
CHUNK = 500  # rows: making a longer chain of calls costs more than calling a short one often
SAME = 1e-8  # of the largest response: nearer than this, two responses are one


@final
@dataclass(frozen=True, eq=False)
class Way:
    """From a port to the exits of a case under a fitted hypothesis.

    outputs: of the hypothesis, per log. held: whether what is put in is a staircase. every: rows from tick to tick
    of what is sampled on the way, 1 where nothing is, 0 where ticks and rows do not go together.
    """

    case: Case
    fitted: Fitted
    port: Port
    outputs: tuple[Array, ...]
    held: bool
    every: int = 1

    def simulated(self, changes: tuple[Array, ...]) -> tuple[Array, ...]:
        """Per log (n, exits): how the exits move when the signal at the port is changed by (n,), by the simulation."""
        return tuple(
            replay.run_driven(self._values(replay), self._put_in(log, rows)) - self.outputs[log]
            for log, (replay, rows) in enumerate(zip(self._replays, changes, strict=True))
        )

    def convolved(self, changes: tuple[Array, ...]) -> tuple[Array, ...] | None:
        """The same by convolution; None where the way is not linear or not the same at all times."""
        if not self.is_quick:
            return None
        found = []
        for rows, (first, _), through in zip(changes, self._pulses, self._spectra, strict=True):
            size = next_fast_len(2 * len(rows), real=True)
            rest = self.read(rows)
            rest[0] = 0.0
            sent = np.fft.irfft(np.fft.rfft(rest, size)[:, None] * through, size, axis=0)
            found.append(sent[: len(rows)] + rows[0] * first)
        return tuple(found)

    @cached_property
    def _spectra(self) -> tuple[NDArray[np.complex128], ...]:
        """Per log: the transform of the answer to a later pulse, long enough for a convolution."""
        sizes = [next_fast_len(2 * len(later), real=True) for _, later in self._pulses]
        return tuple(
            np.fft.rfft(later, size, axis=0) for size, (_, later) in zip(sizes, self._pulses, strict=True)
        )

    @cached_property
    def is_quick(self) -> bool:
        """Whether the convolution holds: two pulses at other times and of other sizes are answered alike.

        Where there are ticks: and a pulse between them is not answered at all.
        """
        return self.every > 0 and all(self._alike(log, later) for log, (_, later) in enumerate(self._pulses))

    def read(self, rows: Array) -> Array:
        """(n,) what of a change is read on the way: all rows, or those at ticks."""
        if self.every <= 1:
            return np.array(rows)
        found = np.zeros(len(rows))
        found[:: self.every] = rows[:: self.every]
        return found

    def weights(self, residual: Array) -> tuple[Array, ...]:
        """Per log (n,): by how much a change of 1 at each row moves the exits along a whitened residual (rows,).

        The adjoint of the convolution; where the way is not linear, of its answer to the first pulse.
        """
        found = []
        for log, (_, later) in enumerate(self._pulses):
            size = next_fast_len(2 * len(later), real=True)
            product = self._spectra[log].conj() * np.fft.rfft(self.case.unfiltered(residual, log), size, axis=0)
            found.append(self.read(np.fft.irfft(product.sum(axis=1), size)[: len(later)]))
        return tuple(found)

    @cached_property
    def gains(self) -> tuple[Array, ...]:
        """Per log: χ² that a change brings where it is read, by its power at each frequency of the rfft."""
        found = []
        for _, later in self._pulses:
            size = len(later)
            through = np.abs(np.fft.rfft(later, size, axis=0)) ** 2
            filters = [np.abs(np.fft.rfft(one.taps, size)) ** 2 for one in self.case.whitening]
            found.append(np.asarray((through * np.stack(filters, axis=1)).sum(axis=1)))
        return tuple(found)

    @cached_property
    def white_power(self) -> float:
        """χ² that a white change of variance 1 where it is read brings to the exits."""
        return sum(float(2 * gain.sum() - gain[0]) for gain in self.gains) / max(self.every, 1)

    def moved(self, changes: tuple[Array, ...]) -> tuple[Array, ...]:
        """By convolution where that is the same, else by the simulation."""
        found = self.convolved(changes)
        return self.simulated(changes) if found is None else found

    @cached_property
    def _probe(self) -> Added:
        return Added("cross_coupling", str(self.port), {"gain": 1.0}, {"source": PROBE}, frozenset({"gain"}))

    @cached_property
    def _replays(self) -> tuple[Replay, ...]:
        empty = tuple(np.zeros(len(r)) for r in self.case.records)
        records = tuple(self._carrying(log, rows) for log, rows in enumerate(empty))
        probed = replace(self.case, records=records, _replays={})
        return probed.replays((*self.fitted.added, self._probe))

    def _values(self, replay: Replay) -> tuple[float, ...]:
        known = {p.path: p.value for p in self.fitted.parameters}
        return tuple(known[path] for path in replay.free)

    def _carrying(self, log: int, rows: Array) -> Record:
        record = self.case.records[log]
        held = record.held | {PROBE} if self.held else record.held
        return Record(record.time, {**record.columns, PROBE: rows}, record.units, held, record.source)

    def _put_in(self, log: int, rows: Array) -> object:
        return self.case.stimuli_for(self._carrying(log, rows), (PROBE,))

    @cached_property
    def _pulses(self) -> tuple[tuple[Array, Array], ...]:
        """Per log: responses (n, exits) to a pulse of 1 at row 0, and at the next tick, counted from there."""
        found, every = [], max(self.every, 1)
        for log in range(len(self.case.records)):
            first, second = (self._pulse(log, row, self._size(log)) for row in (0, every))
            found.append((first, np.vstack([second[every:], np.zeros((every, second.shape[1]))])))
        return tuple(found)

    def _alike(self, log: int, later: Array) -> bool:
        """Whether a pulse in the middle of the log, the other way and twice as high, is answered as the first one."""
        count, every = len(later), self.every
        row, most = (count // 2 // every + 7) * every, float(np.abs(later).max(initial=0.0))
        if not 0 < most < np.inf or row >= count:
            return False
        shifted = np.vstack([np.zeros((row, later.shape[1])), later[: count - row]])
        off = np.abs(self._pulse(log, row, -2 * self._size(log)) - shifted)[: count - every]
        off[row - 1] = 0.0  # the way up to the pulse
        between = self._pulse(log, row + 1, self._size(log), rows=1) if every > 1 else np.zeros(1)
        return bool(max(off.max(initial=0.0), np.abs(between).max()) <= SAME * most)

    def _size(self, log: int) -> float:
        return float(np.std(self.case.measured[log])) or 1.0

    def _pulse(self, log: int, row: int, height: float, rows: int = 0) -> Array:
        """Response to a pulse that lasts from tick to tick, or some rows."""
        put_in = np.zeros(len(self.case.records[log]))
        put_in[row : row + (rows or max(self.every, 1))] = height
        replay = self._replays[log]
        moved = replay.run_driven(self._values(replay), self._put_in(log, put_in)) - self.outputs[log]
        return np.asarray(moved / height)


def way_of(view: View, fitted: Fitted, outputs: tuple[Array, ...], port: Port) -> Way | None:
    """The way that the effect's change takes; None where it must be run in the loop itself.

    That is where it does not stand in a wire (or on the derivative of a measured state), where the wire goes round a
    loop inside the segment, and where logs are in pieces.
    """
    case = view.case
    stands = port.kind in ("input", "output") or moves_as_measured(case.segment.loop, case.exits, port)
    if not stands or case.pieces or _is_round(case.segment.loop, port):
        return None
    held = port.kind != "derivative" and view.is_held(port)
    return Way(case, fitted, port, outputs, held, _ticks(with_added(case.segment.loop, fitted.added), port, case.step))


def _ticks(loop: Loop, port: Port, step: float) -> int:
    """Rows from tick to tick of what samples behind a port; 1 where nothing does, 0 where ticks fall between rows."""
    passed = _behind(loop, port)
    blocks = [element.block for element in resolve(loop).elements if element.name in passed]
    periods = {float(block.period) for block in blocks if isinstance(block, Sampled)}
    if not periods:
        return 1
    rows = min(periods) / step
    return round(rows) if len(periods) == 1 and abs(rows - round(rows)) < 1e-9 * rows and rows > 0.5 else 0


def own_way(view: View, one: Added) -> Element | None:
    """The element that the effect puts into the wire."""
    loop = with_added(view.case.segment.loop, (one,))
    return next((element for element in loop.elements if element.path == path_of(0)), None)


@final
@dataclass(frozen=True, eq=False)
class _Wire:
    """Where an effect stands: rows (s), the signal before them; whether it is held, and whether it is measured."""

    time: Array
    before: float
    held: bool
    shown: bool

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
    for log, u in enumerate(view.at(port)):
        time = view.case.records[log].time - view.case.records[log].time[0]
        more = tuple(view.evaluated(element.inputs[name], log) for name in element.block.inputs[1:])
        wire = _Wire(time, view.before(port, log), view.is_held(port), view.is_exit(port))
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


def _behind(loop: Loop, port: Port) -> set[str]:
    """Names of the blocks that a signal passes behind a port, its own block's input included."""
    readers: dict[str, list[str]] = {}
    for element in loop.elements:
        for name in _read_by(element):
            readers.setdefault(name, []).append(element.name)
    first = [port.element] if port.kind != "output" else readers.get(written_at(loop, port), [])
    waiting, found = list(first), set[str]()
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting.extend(reader for signal in loop[name].outputs.values() for reader in readers.get(signal, ()))
    return found


def _is_round(loop: Loop, port: Port) -> bool:
    """Whether what leaves the port's block comes back to it inside the loop."""
    onward = Port(port.element, "output", next(iter(loop[port.element].outputs)))
    return any(port.element in _behind(loop, replace(onward, name=name)) for name in loop[port.element].outputs)


def _read_by(element: Element) -> tuple[str, ...]:
    wired = [name for x in element.inputs.values() for name in x.names]
    return (*wired, *(name for placed in element.modifiers for name in placed.read))
