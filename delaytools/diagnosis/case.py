"""One segment and the logs that drive it: measured exits against the model under a hypothesis, whitened."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import flat_values
from delaytools.blocks.equations import Equations
from delaytools.diagnosis.added import SEEN, Added, with_added
from delaytools.diagnosis.noise import FEW_ODD, LARGEST, RESOLVED, RESOLVED_HELD, Whitening, wiener_part
from delaytools.estimation.noise_level import difference_noise
from delaytools.loop.loop import Element, Loop
from delaytools.loop.port import find_port, written_at
from delaytools.loop.segments import Segment
from delaytools.loop.values import value_paths, with_numbers
from delaytools.measurement.beginnings import Begun, run_begun, starts_shown
from delaytools.measurement.measures import resolution
from delaytools.signals.expression import Expression
from delaytools.signals.parameter import Parameter
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column, Stimulus, jumping
from delaytools.simulation.replay import Begin, Replay, driven_by

__all__ = ["SURE", "Case", "Rows", "prepared_case"]

Array = NDArray[np.float64]
DIRECTIONS = 12  # of nuisance that a segment hands on
SURE = 3.0  # standard errors that uncertain values of other segments are given: these were judged by another model


@final
@dataclass(frozen=True, eq=False)
class Rows:
    """Where the whitened residuals of a case stand: log and time (s) of each, exits one after the other per log."""

    log: NDArray[np.int64]
    exit: NDArray[np.int64]
    time: Array

    def blocks(self, seconds: float) -> NDArray[np.int64]:
        """A number for every row that says in which stretch of time it lies; the exits of one stretch share it."""
        part = np.floor(self.time / seconds).astype(np.int64)
        _, found = np.unique(np.stack([self.log, part]), axis=1, return_inverse=True)
        return np.asarray(found, dtype=np.int64).ravel()


@final
@dataclass(frozen=True, eq=False)
class Case:
    """A segment with its logs.

    records: the logs, columns as they drive (cleaned where that is better). measured: per log (n, exits).
    tolerated: values that are free within bounds in every fit. smooth: columns without noise. whitening: one filter
    per exit. uncertain: per log, what a standard error of each uncertain value of other segments does to the columns
    that drive this one, (n, k) by name; nuisance: per log (n, exits, k), what that does to the exits. lost: port of a
    sampled output -> share of its updates that the logs show to be lost. outside: columns that no block of the loop
    writes. read_by: columns of what reads an exit itself. pieces: per log, (first, last + 1) of the rows that count;
    the states begin anew with each (() = all rows, from the design's own beginning). numbers: per log, values by path
    that its run had (() = the design's). substeps: of a frame. finer: how many times finer than usual its runs' steps
    are. deadline: monotonic clock, s; a fit that passes it ends where it stands.
    """

    segment: Segment
    records: tuple[Record, ...]
    measured: tuple[Array, ...]
    tolerated: tuple[Parameter, ...]
    at_rest: frozenset[str]
    smooth: frozenset[str] = frozenset()
    whitening: tuple[Whitening, ...] = ()
    uncertain: tuple[Mapping[str, Array], ...] = ()
    nuisance: tuple[Array, ...] = ()
    lost: Mapping[str, float] = field(default_factory=dict)
    outside: frozenset[str] = frozenset()
    read_by: frozenset[str] = frozenset()
    pieces: tuple[tuple[tuple[int, int], ...], ...] = ()
    numbers: tuple[Mapping[str, float], ...] = ()
    substeps: int | None = None
    finer: int = 1
    deadline: float = np.inf
    _replays: dict[Any, tuple[Replay, ...]] = field(default_factory=dict, repr=False)
    _steps: dict[int, dict[str, NDArray[np.int64]]] = field(default_factory=dict, repr=False)
    _begun_last: dict[int, Begun] = field(default_factory=dict, repr=False)

    @property
    def exits(self) -> tuple[str, ...]:
        """The measured signals that the segment writes."""
        return self.segment.exits

    def exit_at(self, at: str) -> int | None:
        """The place among the exits of the signal that a port writes; None where that is not measured."""
        port = find_port(self.segment.loop, at)
        signal = written_at(self.segment.loop, port) if port.kind == "output" else ""
        return self.exits.index(signal) if signal in self.exits else None

    @cached_property
    def rows(self) -> Rows:
        """Where each whitened residual stands."""
        parts = [
            (np.full(len(r), k), np.full(len(r), j), r.time - r.time[0])
            for k, r in enumerate(self.records)
            for j in range(len(self.exits))
        ]
        log, exit, time = (np.concatenate(group) for group in zip(*parts, strict=True))
        return Rows(log, exit, time)

    @property
    def step(self) -> float:
        """Usual time between rows, s; to 12 decimals, since periods that are multiples of it must meet the rows."""
        return round(float(np.median(np.diff(self.records[0].time))), 12)

    @property
    def duration(self) -> float:
        """Length of the longest log, s."""
        return max(float(r.time[-1] - r.time[0]) for r in self.records)

    @cached_property
    def is_driven_by_jumps(self) -> bool:
        """Whether a column jumps now and then: when between two rows, nobody knows."""
        names = [n for n in self.segment.entries if n in self.smooth and n in self.records[0]]
        slopes = (np.diff(r[n]) / np.diff(r.time) for r in self.records for n in names if n not in r.held)
        return self.is_driven_by_steps or any(bool(jumping(one).any()) for one in slopes)

    @cached_property
    def is_driven_by_steps(self) -> bool:
        """Whether a column that is not held takes few values: every one of its moves is a jump within a row."""
        first = self.records[0]
        return any(resolution(first[n]) > 0 for n in self.segment.entries if n in first and n not in first.held)

    @property
    def is_late(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() >= self.deadline

    def parameters(self, added: tuple[Added, ...]) -> tuple[Parameter, ...]:
        """Everything that a fit of this hypothesis moves: what is tolerated, then the effects' values."""
        loop = self.segment.loop
        changed = {f"{a.at}.{a.kind.partition(':')[2]}" for a in added if ":" in a.kind}
        kept = tuple(p for p in self.tolerated if p.path not in changed)
        return kept + tuple(p for k, one in enumerate(added) for p in one.parameters(loop, k))

    def replays(self, added: tuple[Added, ...]) -> tuple[Replay, ...]:
        """One replay per log of the segment with these effects."""
        key = tuple(one.shape for one in added)
        if key not in self._replays:
            if len(self._replays) > 40:
                self._replays.clear()
            step = ("step", *(one.step_shape for one in added))
            if step not in self._replays:
                loop = with_added(self.segment.loop, added)
                free = tuple(p.path for p in self.parameters(added))
                self._replays[step] = tuple(self._replay(loop, free, log) for log in range(len(self.records)))
            times = {path: value for k, one in enumerate(added) for path, value in one.held_times(k).items()}
            self._replays[key] = tuple(replace(one, bound=tuple(times.items())) for one in self._replays[step])
        return self._replays[key]

    def _replay(self, loop: Loop, free: tuple[str, ...], log: int) -> Replay:
        record = self.records[log]
        if self.numbers:
            loop = with_numbers(loop, {path: v for path, v in self.numbers[log].items() if path not in free})
        driven, time = self._stimuli(record, loop.externals), record.time - record.time[0]
        steps = self._steps.setdefault(log, {})
        return Replay(loop, driven, time, self.exits, free, self._begins[log], self.substeps, self.finer, steps)

    @cached_property
    def _begins(self) -> tuple[tuple[Begin, ...], ...]:
        if not self.pieces:
            return ((),) * len(self.records)
        loop = self.segment.loop
        return tuple(
            starts_shown(loop, record, [first for first, _ in pieces])
            for record, pieces in zip(self.records, self.pieces, strict=True)
        )

    def stimuli_for(self, record: Record, names: tuple[str, ...]) -> Mapping[str, Stimulus]:
        """The columns of a record that drive these external signals."""
        return self._stimuli(record, names)

    def _stimuli(self, record: Record, names: tuple[str, ...]) -> Mapping[str, Stimulus]:
        from_log = {name: name.removesuffix("@read") for name in names if not name.endswith(SEEN)}
        found = driven_by(
            record, set(from_log.values()), at_rest=self.at_rest & record.held, smooth=self.smooth
        )
        seen = {name: _seen(record, name.removesuffix(SEEN)) for name in names if name.endswith(SEEN)}
        return {**{name: found[column] for name, column in from_log.items() if column in found}, **seen}

    def outputs(self, added: tuple[Added, ...], values: tuple[float, ...]) -> tuple[Array, ...]:
        """Per log (n, exits): the model's exits for these values of `parameters(added)`.

        Where logs are in pieces, with the beginnings that fit best, and as measured outside of them.
        """
        if not self.pieces:
            return tuple(replay.run(values) for replay in self.replays(added))
        runs = [self._begun(log, replay, values) for log, replay in enumerate(self.replays(added))]
        pairs = zip(self.measured, runs, strict=True)
        return tuple(m - one.without((m - y)[:, :, None])[:, :, 0] for m, (y, one) in pairs)

    def outputs_nearly(self, added: tuple[Added, ...], values: tuple[float, ...]) -> tuple[Array, ...]:
        """As `outputs`, but beginnings act as they did in the last exact run: for screening, at half the cost."""
        if not self.pieces or len(self._begun_last) < len(self.records):
            return self.outputs(added, values)
        runs = [replay.run(values) for replay in self.replays(added)]
        last = [replace(self._begun_last[log], filters=self._applied) for log in range(len(runs))]
        trios = zip(self.measured, runs, last, strict=True)
        return tuple(m - one.without((m - y)[:, :, None])[:, :, 0] for m, y, one in trios)

    def _begun(self, log: int, replay: Replay, values: tuple[float, ...]) -> tuple[Array, Begun]:
        rows, self._begun_last[log] = run_begun(
            replay, values, self.measured[log], self.pieces[log], self._applied
        )
        return rows, self._begun_last[log]

    @property
    def _applied(self) -> tuple[Callable[[Array], Array], ...]:
        return tuple(one.apply for one in self.whitening)

    def residual(self, outputs: tuple[Array, ...]) -> Array:
        """(rows,): measured minus model, whitened."""
        return self.whitened(tuple(m - y for m, y in zip(self.measured, outputs, strict=True)))

    def whitened(self, signals: tuple[Array, ...]) -> Array:
        """(rows,) or (rows, k): signals at the exits, per log (n, exits) or (n, exits, k), through the filters.

        What uncertain values of other segments could do there counts as noise.
        """
        return self.less_nuisance(self._filtered(signals))

    def less_nuisance(self, rows: Array) -> Array:
        """(rows,) or (rows, k): rows that went through the filters, whitened for the uncertain values as well."""
        basis = self._nuisance_basis
        return rows - basis @ (basis.T @ rows) if basis.shape[1] else rows

    @cached_property
    def _nuisance_basis(self) -> Array:
        """(rows, k): B with rows - B Bᵀ rows whitened for errors of the uncertain values as well as for the noise.

        With one standard error of each in N = Q diag(s) Vᵀ, the covariance is I + N Nᵀ, and its inverse root
        I - Q diag(1 - 1/√(1 + s²)) Qᵀ: what the values can hardly do stays.
        """
        if not self.nuisance or not self.whitening:
            return np.zeros((0, 0))
        sides, sizes, _ = np.linalg.svd(SURE * self._filtered(self.nuisance), full_matrices=False)
        return np.asarray(sides * np.sqrt(1 - 1 / np.sqrt(1 + sizes**2)))

    def without_nuisance(self, residual: tuple[Array, ...]) -> tuple[Array, ...]:
        """Residuals per log (n, exits), less what errors of uncertain values of other segments most likely did."""
        if not self.nuisance:
            return residual
        rows = SURE * self._filtered(self.nuisance)
        square = rows.T @ rows + np.eye(rows.shape[1])
        weights = SURE * np.linalg.solve(square, rows.T @ self._filtered(residual))
        return tuple(r - n @ weights for r, n in zip(residual, self.nuisance, strict=True))

    def nuisance_left(self) -> tuple[Array, ...]:
        """Per log (n, exits, k): one standard error each of what the logs leave uncertain of the nuisance, the largest.

        By the covariance of its weights after the logs: (I + RᵀR)⁻¹ with R the whitened nuisance.
        """
        if not self.nuisance:
            return tuple(np.zeros((*m.shape, 0)) for m in self.measured)
        rows = SURE * self._filtered(self.nuisance)
        root = np.linalg.inv(np.linalg.cholesky(rows.T @ rows + np.eye(rows.shape[1]))).T
        own = np.concatenate([one.reshape(-1, one.shape[2]) @ root for one in self.nuisance])
        turned = np.linalg.svd(own, full_matrices=False)[2][:DIRECTIONS].T
        return tuple(one @ (root @ turned) for one in self.nuisance)

    def _filtered(self, signals: tuple[Array, ...]) -> Array:
        pieces = self.pieces or tuple(((0, len(rows)),) for rows in signals)
        parts = [
            self._through(j, rows[:, j], own)
            for rows, own in zip(signals, pieces, strict=True)
            for j in range(len(self.exits))
        ]
        return np.concatenate(parts)

    def _through(self, exit: int, rows: Array, pieces: tuple[tuple[int, int], ...]) -> Array:
        """Rows through the filter of an exit, piece by piece; 0 outside."""
        if pieces == ((0, len(rows)),):
            return self.whitening[exit].apply(rows)
        found = np.zeros_like(rows)
        for first, last in pieces:
            found[first:last] = self.whitening[exit].apply(rows[first:last])
        return found

    @cached_property
    def cut_levels(self) -> Array:
        """(rows,): sizes of whitened residuals beyond which no noise goes, by the noise that the columns show."""
        found = []
        for record in self.records:
            for exit, one in zip(self.exits, self.whitening, strict=True):
                least = RESOLVED_HELD if exit in record.held else RESOLVED
                noise = max(difference_noise(record[exit]), least * float(np.std(record[exit])))
                level = LARGEST * max(noise * abs(float(one.taps[0])), 1.0 if len(one.taps) > 1 else 0.0)
                found.append(np.full(len(record), level))
        return np.concatenate(found)

    def without_odd_rows(self, rows: Array) -> Array:
        """Whitened residuals (rows,), those beyond the levels cut to them where these are few.

        Behind a quantiser such a row was rounded the other way, by noise ahead of it: a whole step, and no structure.
        """
        cut = np.clip(rows, -self.cut_levels, self.cut_levels)
        return cut if (cut != rows).mean() < FEW_ODD else rows

    def unfiltered(self, rows: Array, log: int) -> Array:
        """(n, exits): the adjoint of `whitened` on the rows (rows,) of one log, which are in one piece."""
        rows = self.less_nuisance(rows)
        chosen = [rows[(self.rows.log == log) & (self.rows.exit == j)] for j in range(len(self.exits))]
        return np.stack([f.apply(part[::-1])[::-1] for f, part in zip(self.whitening, chosen, strict=True)], axis=1)

    def with_derivatives(
        self, added: tuple[Added, ...], values: tuple[float, ...], *, nearly: bool = False
    ) -> tuple[Array, Array]:
        """(rows,) whitened residual and (rows, free): its derivative by each free value.

        nearly: with delays between those whose runs are kept.
        """
        replays = self.replays(added)
        slopes = [r.run_between(values) if nearly else r.run_with_derivatives(values) for r in replays]
        if not self.pieces:
            return self.residual(tuple(y for y, _ in slopes)), -self.whitened(tuple(rows for _, rows in slopes))
        left, moved = [], []
        for log, (replay, (y, rows)) in enumerate(zip(replays, slopes, strict=True)):
            _, begun = self._begun(log, replay, replay.on_grid(values) if nearly else values)
            both = begun.without(np.concatenate([(self.measured[log] - y)[:, :, None], rows], axis=2))
            left.append(both[:, :, 0])
            moved.append(both[:, :, 1:])
        return self.whitened(tuple(left)), -self.whitened(tuple(moved))

    def whitened_by(self, whitening: tuple[Whitening, ...]) -> "Case":
        """The same case seen through other filters.

        Logs in pieces are real runs, whose errors are the model's rather than noise: to whiten these would count most
        where the model is worst known. They are weighted evenly, at the level that allows for their colour.
        """
        return replace(self, whitening=tuple(w.evenly() for w in whitening) if self.pieces else whitening)

    def roughly(self) -> "Case":
        """The same case with residuals by their rms alone.

        In a real run most of the residual is the effect that is missing, and slow: allowed for as coloured noise it
        would hide what causes it. So candidates are sought, and judged by the filters of what they leave.
        """
        return replace(self, whitening=tuple(replace(w, taps=np.array([1 / w.rms])) for w in self.whitening))


def prepared_case(
    segment: Segment, records: tuple[Record, ...], tolerated: tuple[Parameter, ...], at_rest: frozenset[str]
) -> Case:
    """The case of a segment, without filters yet; `tolerated` may name values of other segments, left out here."""
    read = {f"parameters.{name}" for name in _parameters_read(segment.loop)}
    known = {path for path in value_paths(segment.loop) if not path.startswith("parameters.") or path in read}
    own = tuple(p for p in tolerated if p.path in known)
    measured = tuple(np.stack([r[exit] for exit in segment.exits], axis=1) for r in records)
    return Case(segment, records, measured, own, at_rest)


def _seen(record: Record, exit: str) -> Stimulus:
    """A measured exit without its noise."""
    rows = record[exit]
    noise = 0.0 if exit in record.held else difference_noise(rows)
    rows = wiener_part(rows, noise) if noise > 0 else rows
    return Column(time=record.time - record.time[0], values=rows, smooth=True)


def _parameters_read(loop: Loop) -> set[str]:
    """Names of [parameters] that the loop's elements read, themselves or through other parameters."""
    waiting = [name for element in loop.elements for name in _names(element)]
    found = set[str]()
    while waiting:
        name = waiting.pop()
        if name in loop.parameters and name not in found:
            found.add(name)
            formula = loop.parameters[name]
            waiting.extend(formula.names if isinstance(formula, Expression) else ())
    return found


def _names(element: Element) -> set[str]:
    """Names that an element's wiring and values read, its effects' included."""
    homes = (element.block, *(placed.modifier for placed in element.modifiers))
    values = [item for home in homes for item in flat_values(home).values()]
    shared = element.block.shared if isinstance(element.block, Equations) else ()
    return {n for x in (*element.inputs.values(), *values) if isinstance(x, Expression) for n in x.names} | set(shared)
