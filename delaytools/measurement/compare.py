"""Model against measurement: each measured signal against its segment driven by what was measured at its entries."""

from collections.abc import Mapping, Sequence
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from delaytools.design.build import build
from delaytools.design.design import Design
from delaytools.loop.loop import Loop
from delaytools.loop.network import network
from delaytools.loop.segments import segments
from delaytools.loop.values import resolve
from delaytools.measurement.closed_loop_run import closed_loop_runs
from delaytools.measurement.comparison import Comparison, SignalComparison
from delaytools.measurement.judge import Judged, judged
from delaytools.measurement.measures import counted, cut, figures, resolution
from delaytools.measurement.pieces import pieces_in_words, pieces_of
from delaytools.measurement.segment_runs import (
    SegmentRun,
    column_noise,
    held_by_design,
    prepared,
    run_segment,
)
from delaytools.measurement.shares import strips, worst_bands, worst_levels, worst_times
from delaytools.measurement.where import where_it_fails
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError

__all__ = ["compare"]

Array = NDArray[np.float64]


def compare(
    design: Design | Loop, records: Sequence[Record], *, configuration: str | None = None
) -> Comparison:
    """How much each measured signal differs from the model, where, and whether its noise explains it.

    The loop is cut at its measured signals; each piece is run from the measured signals at its entries alone, so an
    error stays where it arises, and an unstable loop can be compared. Nothing is fitted. The noise of a measured input
    is sent through the piece too: what it does there is no error of the model. Several logs: figures of each, and of
    all together. What the design says under [log] holds: rows that do not count are left out, and the states begin
    anew with each stretch of a log where it does not begin at rest. Raises DesignError where no measured signal is
    written by a block, AnalysisError without a log.
    """
    if not records:
        raise AnalysisError("no log to compare with", advice="give at least one log")
    loop = build(design, configuration) if isinstance(design, Design) else design
    marked = [held_by_design(design, record) for record in records] if isinstance(design, Design) else records
    ready, words = prepared(loop, marked)
    measured = set(ready[0].names).intersection(*(record.names for record in ready))
    ready = tuple(record.only(n for n in record.names if n in measured) for record in ready)
    tolerated = tuple(design.tables.tolerance) if isinstance(design, Design) else ()
    sampled = network(resolve(loop)).held_signals
    pieces = pieces_of(design, ready) if isinstance(design, Design) else ()
    said = pieces_in_words(design, pieces) if isinstance(design, Design) else ()
    runs = [run_segment(part, ready, sampled, pieces) for part in segments(loop, measured)]
    references = [n for n in loop.externals if n in measured]
    found = [
        _signal(run, exit, ready, references, loop)
        for run in runs
        if not run.why
        for exit in run.segment.exits
    ]
    order = {name: k for k, name in enumerate(loop.signals)}
    found = sorted(found, key=lambda one: order[one.signal])
    return Comparison(
        signals=tuple(found),
        where=where_it_fails(found, tolerated),
        closed_loop=closed_loop_runs(loop, ready),
        not_compared={exit: run.why for run in runs if run.why for exit in run.segment.exits},
        notes=(*words, *said, *_said(tolerated)),
    )


def _said(tolerated: Sequence[str]) -> tuple[str, ...]:
    if not tolerated:
        return ()
    names = ", ".join(tolerated)
    return (
        f"nothing was fitted: {names} stand at their nominal values, though [tolerance] lets them be off",
    )


def _signal(
    run: SegmentRun, exit: str, records: Sequence[Record], references: Sequence[str], loop: Loop
) -> SignalComparison:
    traces, held = run.traces[exit], exit in records[0].held
    names = [_log_name(record, k) for k, record in enumerate(records)]
    overall = figures("all logs" if len(traces) > 1 else names[0], traces, held=held)
    each = tuple(figures(n, [trace], held=held) for n, trace in zip(names, traces, strict=True))
    if overall.rms_error is None:
        traces = tuple((t, y, np.where(np.isinf(m), 0.0, m)) for t, y, m in traces)
    rows = counted(traces)
    columns = [[records[log][name][part] for log, part in rows] for name in references]
    carried = [run.carried[exit][log][part] for log, part in rows]
    parts = [record.rows(~np.isnan(m)) for record, (_, _, m) in zip(records, traces, strict=True)]
    verdict = judged(cut(traces), _own_noise(parts, exit), carried, columns)
    unit = loop.units.get(exit, "")
    spread = strips(traces, verdict.spectra, unit)
    return SignalComparison(
        signal=exit, unit=unit, driven_by=run.segment.entries, blocks=run.segment.blocks, overall=overall,
        logs=each if len(each) > 1 else (), noise_rms=verdict.noise_rms, carried_noise_rms=verdict.carried_rms,
        explained_rms=verdict.explained_rms, difference_rms=verdict.difference_rms,
        worst_times=worst_times(spread), worst_bands=worst_bands(spread), worst_levels=worst_levels(spread),
        strips=spread, traces=traces, **_verdict(verdict, overall.why),
    )  # fmt: skip


def _verdict(found: Judged, why: Mapping[str, str]) -> dict[str, str]:
    if "rms_error" in why:
        return {"verdict": "fails", "reason": why["rms_error"]}
    return {"verdict": found.verdict, "reason": found.reason}


def _own_noise(records: Sequence[Record], exit: str) -> float:
    """Noise of a measured signal without a model; of a coarse one that of its rounding, of a held one none."""
    if exit in records[0].held:
        return 0.0
    sizes = [column_noise(r, exit) or resolution(r[exit]) / np.sqrt(12.0) for r in records]
    return float(np.sqrt(np.mean(np.square(sizes))))


def _log_name(record: Record, number: int) -> str:
    return PurePath(record.source.partition("; ")[0]).name or f"log {number + 1}"
