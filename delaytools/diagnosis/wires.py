"""What an effect in a wire does to the exits: what it changes at its port, sent through the rest of the segment.

Where the segment behind the port is linear and the same at all times (checked, not assumed) the change is convolved
with the response to a pulse; elsewhere the one simulation runs with the change put in as a column. Either way the
effect itself need not be compiled into the loop.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from delaytools.blocks.block import Sampled
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

__all__ = ["Way", "own_way", "way_of"]

Array = NDArray[np.float64]
PROBE = "probe@wire"
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
