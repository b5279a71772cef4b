"""Segments run on logs: what the model says at each measured exit, and what the noise of measured inputs does to it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.design.design import Design
from delaytools.estimation.noise_level import difference_noise
from delaytools.loop.loop import Loop
from delaytools.loop.network import network
from delaytools.loop.segments import Segment
from delaytools.loop.values import resolve
from delaytools.measurement.log_checks import check_raster
from delaytools.measurement.measures import Trace, resolution
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


def run_segment(segment: Segment, records: Sequence[Record], sampled: Collection[str] = ()) -> SegmentRun:
    """The segment driven by what each log measured at its entries.

    sampled: signals that sampled blocks write; they were 0 before a log that starts at t = 0.
    """
    absent = [n for n in segment.entries if n not in records[0] and n not in segment.loop.random]
    if absent:
        return SegmentRun(segment, {}, {}, {}, f"no column for {', '.join(absent)}, which drives it")
    sent = {n: column_noise(records[0], n) for n in segment.entries if n in records[0]}
    sent = {n: size for n, size in sent.items() if size > 0}
    try:
        pairs = [_run(segment, record, sent, sampled) for record in records]
    except DelaytoolsError as error:
        return SegmentRun(segment, {}, {}, {}, str(error))
    traces = {
        exit: tuple((r.time, r[exit], rows[:, j]) for r, (rows, _) in zip(records, pairs, strict=True))
        for j, exit in enumerate(segment.exits)
    }
    carried = {exit: tuple(change[:, j] for _, change in pairs) for j, exit in enumerate(segment.exits)}
    return SegmentRun(segment, traces, carried, sent)


def _run(
    segment: Segment, record: Record, sent: Mapping[str, float], sampled: Collection[str]
) -> tuple[Array, Array]:
    """(n, exits) of the model, and what noise on the entries adds to it.

    Columns are joined by straight lines or by splines between rows, whichever leaves less: what lies between the rows
    is not known, and no error of the model.
    """
    curved = [n for n in segment.entries if n in record and n not in record.held and resolution(record[n]) == 0]
    smooth, rows = _nearest(segment, record, sampled, curved)
    if not sent or not np.isfinite(rows).all():
        return rows, np.zeros_like(rows)
    draw = np.random.default_rng(SEED)
    noisy = {n: record[n] + size * draw.standard_normal(len(record)) for n, size in sent.items()}
    moved = Record(record.time, {**record.columns, **noisy}, record.units, record.held)
    return rows, _replay(segment, moved, sampled, smooth).run() - rows


def _nearest(
    segment: Segment, record: Record, sampled: Collection[str], curved: Sequence[str]
) -> tuple[Sequence[str], Array]:
    """Which columns are joined by a spline (all or none), and the rows of the model then."""
    measured = np.stack([record[exit] for exit in segment.exits], axis=1)
    straight = _finite(_replay(segment, record, sampled, ()).run(), measured)
    if not curved or not np.isfinite(straight).all():
        return (), straight
    spline = _finite(_replay(segment, record, sampled, curved).run(), measured)
    size = np.where(measured.std(axis=0) > 0, measured.std(axis=0), 1.0)
    left = [float(np.sum(((measured - rows) / size) ** 2)) for rows in (spline, straight)]
    return (curved, spline) if left[0] < left[1] else ((), straight)


def _finite(rows: Array, measured: Array) -> Array:
    """The rows, NaN where the model has run away."""
    far = RUNAWAY * max(float(np.abs(measured).max(initial=0.0)), 1.0)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(rows) < far, rows, np.nan)


def _replay(segment: Segment, record: Record, sampled: Collection[str], smooth: Collection[str]) -> Replay:
    columns = {name: name.removesuffix("@read") for name in segment.loop.externals}
    rest = [n for n in sampled if n in record.held and abs(float(record.time[0])) < START]
    driven = driven_by(record, set(columns.values()), at_rest=rest, smooth=smooth)
    stimuli = {name: driven[column] for name, column in columns.items() if column in driven}
    return Replay(segment.loop, stimuli, record.time - record.time[0], segment.exits)
