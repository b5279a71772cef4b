"""Segments run on logs: what the model says at each measured exit, and what the noise of measured inputs does to it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.design.design import Design
from delaytools.estimation.noise_level import difference_noise
from delaytools.loop.loop import Loop
from delaytools.loop.network import network
from delaytools.loop.segments import Segment
from delaytools.loop.values import resolve
from delaytools.measurement.beginnings import run_begun, starts_shown
from delaytools.measurement.log_checks import check_raster
from delaytools.measurement.measures import Trace, resolution
from delaytools.measurement.pieces import counting_rows
from delaytools.measurement.staircase import with_staircases_held
from delaytools.signals.record import Record
from delaytools.signals.trouble import DelaytoolsError
from delaytools.simulation.replay import Replay, driven_by

__all__ = ["SegmentRun", "column_noise", "held_by_design", "prepared", "run_segment"]

Array = NDArray[np.float64]
SEED = 7
RESOLVED = 3e-5  # of a signal's size: below it, differences are rounding
RUNAWAY = 1e9  # times what was measured
START = 1e-9  # s: a log whose first row is at t = 0
PIECEWISE = 0.02  # of its rows: a signal that changes in fewer keeps its value between


@final
@dataclass(frozen=True, eq=False)
class SegmentRun:
    """A segment on its logs. traces: exit -> per log (time, measured, model). carried: exit -> per log (n,).

    The model is NaN in rows that do not count, infinite where it has run away.
    sent: entry -> standard deviation of its own noise, where it has some. why: in words, where it could not be run.
    """

    segment: Segment
    traces: Mapping[str, tuple[Trace, ...]]
    carried: Mapping[str, tuple[Array, ...]]
    sent: Mapping[str, float]
    why: str = ""


def held_by_design(design: Design, record: Record) -> Record:
    """The record with the columns marked as held that [log] says are."""
    return replace(record, held=record.held | (frozenset(design.tables.log.held) & frozenset(record.names)))


def prepared(loop: Loop, records: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    """The records with their held signals marked, and what was found in words.

    Held: what a sampled block writes, staircases, and external inputs that change in few rows.
    """
    held, found, words = network(resolve(loop)).held_signals, [], list[str]()
    for record in records:
        check_raster(record, loop.frame)
        marked, said = with_staircases_held(record)
        steps = {
            n for n in loop.externals if n in record and 0 < np.mean(np.diff(record[n]) != 0) < PIECEWISE
        }
        found.append(replace(marked, held=marked.held | steps | (held & frozenset(record.names))))
        words += [word for word in said if word.split()[0] not in held and word not in words]
    return tuple(found), tuple(words)


def column_noise(record: Record, name: str) -> float:
    """White noise of a column without a model; 0 where it is held, coarse, or as good as exact."""
    values = record[name]
    if name in record.held or resolution(values) > 0:
        return 0.0
    found = difference_noise(values)
    return found if found > RESOLVED * float(np.abs(values).max(initial=0.0)) else 0.0


def run_segment(
    segment: Segment,
    records: Sequence[Record],
    sampled: Collection[str] = (),
    pieces: Sequence[tuple[tuple[int, int], ...]] = (),
) -> SegmentRun:
    """The segment driven by what each log measured at its entries.

    sampled: signals that sampled blocks write; they were 0 before a log that starts at t = 0. pieces: per log,
    (first, last + 1) of the rows that count, the states beginning anew with each as fits best; () = all, from rest.
    """
    absent = [n for n in segment.entries if n not in records[0] and n not in segment.loop.random]
    if absent:
        return SegmentRun(segment, {}, {}, {}, f"no column for {', '.join(absent)}, which drives it")
    each = pieces or ((),) * len(records)
    counted = records[0].rows(counting_rows(records[0], each[0]))
    sent = {n: column_noise(counted, n) for n in segment.entries if n in counted}
    sent = {n: size for n, size in sent.items() if size > 0}
    try:
        runs = [_OnLog(segment, r, sampled, own).rows(sent) for r, own in zip(records, each, strict=True)]
    except DelaytoolsError as error:
        return SegmentRun(segment, {}, {}, {}, str(error))
    traces = {
        exit: tuple((r.time, r[exit], rows[:, j]) for r, (rows, _) in zip(records, runs, strict=True))
        for j, exit in enumerate(segment.exits)
    }
    carried = {exit: tuple(change[:, j] for _, change in runs) for j, exit in enumerate(segment.exits)}
    return SegmentRun(segment, traces, carried, sent)


@final
@dataclass(frozen=True, eq=False)
class _OnLog:
    """A segment on one log, in pieces (() = whole, from rest)."""

    segment: Segment
    record: Record
    sampled: Collection[str]
    pieces: tuple[tuple[int, int], ...]

    def rows(self, sent: Mapping[str, float]) -> tuple[Array, Array]:
        """(n, exits) of the model, and what noise of these sizes on the entries adds to it.

        Columns are joined by straight lines or by splines between rows, whichever leaves less: what lies between the
        rows is not known, and no error of the model.
        """
        smooth, rows = self._nearest()
        if not sent or not np.isfinite(rows[self._counted]).all():
            return rows, np.zeros_like(rows)
        draw, record = np.random.default_rng(SEED), self.record
        noisy = {n: record[n] + size * draw.standard_normal(len(record)) for n, size in sent.items()}
        moved = Record(record.time, {**record.columns, **noisy}, record.units, record.held)
        return rows, self._run(moved, smooth) - rows

    def _nearest(self) -> tuple[Sequence[str], Array]:
        """Which columns are joined by a spline (all or none), and the rows of the model then."""
        record, rows = self.record, self._counted
        curved = [
            n for n in self.segment.entries if n in record and n not in record.held and resolution(record[n]) == 0
        ]
        straight = self._finite(self._run(record, ()))
        if not curved or not np.isfinite(straight[rows]).all():
            return (), straight
        spline = self._finite(self._run(record, curved))
        spread = self._measured[rows].std(axis=0)
        size = np.where(spread > 0, spread, 1.0)
        left = [float(np.sum(((self._measured - found)[rows] / size) ** 2)) for found in (spline, straight)]
        return (curved, spline) if left[0] < left[1] else ((), straight)

    @cached_property
    def _measured(self) -> Array:
        return np.stack([self.record[exit] for exit in self.segment.exits], axis=1)

    @cached_property
    def _counted(self) -> NDArray[np.bool_]:
        """(n,) which rows count."""
        return counting_rows(self.record, self.pieces)

    def _finite(self, rows: Array) -> Array:
        """The rows, infinite where the model has run away."""
        far = RUNAWAY * max(float(np.abs(self._measured).max(initial=0.0)), 1.0)
        with np.errstate(invalid="ignore"):
            near = np.where(np.abs(rows) < far, rows, np.inf)
        near[~self._counted] = np.nan
        return near

    def _run(self, record: Record, smooth: Collection[str]) -> Array:
        segment, time = self.segment, record.time - record.time[0]
        columns = {name: name.removesuffix("@read") for name in segment.loop.externals}
        rest = [n for n in self.sampled if n in record.held and abs(float(record.time[0])) < START]
        driven = driven_by(record, set(columns.values()), at_rest=rest, smooth=smooth)
        stimuli = {name: driven[column] for name, column in columns.items() if column in driven}
        begins = starts_shown(segment.loop, record, [first for first, _ in self.pieces])
        replay = Replay(segment.loop, stimuli, time, segment.exits, begins=begins)
        if not self.pieces:
            return replay.run()
        rows, begun = run_begun(replay, (), self._measured, self.pieces)
        return self._measured - begun.without((self._measured - rows)[:, :, None])[:, :, 0]
