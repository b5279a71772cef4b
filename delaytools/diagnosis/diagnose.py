"""Which physical effect is missing: logs against a design, segment by segment."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.design.build import build
from delaytools.design.design import Design
from delaytools.design.tolerance import tolerances
from delaytools.diagnosis.answer import Diagnosis, Interrupted, Quantity, Step
from delaytools.diagnosis.case import prepared_case
from delaytools.diagnosis.driving import driven_best
from delaytools.diagnosis.extent import searched_rows
from delaytools.diagnosis.noise import Whitening, wiener_part
from delaytools.diagnosis.noise_of import EXACT, Carried, column_noise
from delaytools.diagnosis.runs import as_logged, differing
from delaytools.diagnosis.search import Finding, search
from delaytools.diagnosis.second_look import begun_again
from delaytools.diagnosis.segment_report import SegmentReport, segment_report
from delaytools.diagnosis.sources import quiet_sources
from delaytools.diagnosis.workers import workers
from delaytools.loop.loop import Loop
from delaytools.loop.network import network
from delaytools.loop.segments import Segment, segments
from delaytools.loop.values import resolve
from delaytools.measurement.log_checks import check_raster
from delaytools.measurement.pieces import pieces_in_words, pieces_of
from delaytools.measurement.segment_runs import held_by_design
from delaytools.measurement.staircase import with_staircases_held
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError

__all__ = ["Effort", "diagnose"]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
Band = Mapping[str, tuple[float, float]]  # signal -> limits
BUDGET, SEARCHED = 170.0, 0.8  # s, and the part of it after which searches end: a last step and the figures take time
WAITING = 0.08  # of it that is kept for every round of segments, side by side, that is still to be searched


@final
@dataclass(frozen=True)
class Effort:
    """How much a diagnosis may cost.

    budget: s that an answer may take; searches end where they stand in time for it, which `budget_exhausted` then says.
    seed: of the noise by which it is judged what noise on a measured input does further on. signals: measured ones to
    be explained (() = all that the design writes).
    """

    processes: int = 2
    budget: float = BUDGET
    seed: int = 1
    signals: tuple[str, ...] = ()


@final
@dataclass(frozen=True, eq=False)
class _Task:
    """One segment for one process; cleaned: per log, columns without the noise of their pick-off.

    quiet: the same by the design alone, and that noise, for sources of effects whose own segment is not done.
    moved: per log, what a standard error of each fitted value does to these columns, (n, k). noise: of columns.
    limits: deadline (s, monotonic clock) and seed. pieces: per log, the rows that count. numbers: per log, the values
    of its configuration.
    """

    design: Design
    configuration: str | None
    records: tuple[Record, ...]
    cleaned: tuple[dict[str, Array], ...]
    moved: tuple[dict[str, Array], ...]
    noise: dict[str, Whitening]
    quiet: tuple[tuple[dict[str, Array], ...], dict[str, Whitening]]
    pieces: tuple[tuple[tuple[int, int], ...], ...]
    numbers: tuple[Mapping[str, float], ...]
    index: int
    limits: tuple[float, int]


def diagnose(
    design: Design,
    records: Sequence[Record],
    *,
    configuration: str | Sequence[str | None] | None = None,
    window: float | None = None,
    progress: Progress | None = None,
    effort: Effort | None = None,
) -> Diagnosis:
    """What the design lacks, by logs of runs that it should explain.

    Each segment between measured signals is driven by what was measured at its entries. Candidates are the catalogue
    at every port and every value of its blocks; each is fitted together with what [tolerance] leaves free, and judged
    on time blocks (or logs) that were not used for its fit. configuration: of all logs, or one per log where they
    differ (in numbers alone); fitted values and effects are shared. window: length in s of pieces in which the logs are
    compared, their beginnings fitted (default: as [log] says). progress: called with words and the share done.
    effort: processes, seconds and seed. The same logs and seed give the same answer.
    Raises DelaytoolsError for a log that lacks what drives a segment, Interrupted with what is finished.
    """
    begin, effort = time.monotonic(), effort or Effort()
    each = _configurations(configuration, len(records))
    loop = build(design, each[0])
    rows, left_out = searched_rows(records)
    ready, words = _prepared(loop, [held_by_design(design, record) for record in rows])
    pieces, numbers = pieces_of(design, ready, window), differing(design, each)
    words = (*words, *left_out, *pieces_in_words(design, pieces, window))
    parts = segments(loop, set(ready[0].names))
    _check_driven(parts, ready, loop)
    quiet = quiet_sources(() if pieces else parts, ready, network(resolve(loop)).held_signals)
    cleaned, moved, noise = _columns(len(ready)), _columns(len(ready)), dict[str, Whitening]()
    done: dict[int, SegmentReport] = {}
    waves = _wanted(_waves(parts, ready), parts, effort.signals)
    ends = _ends(waves, begin, effort)
    try:
        with workers(effort.processes) as share:
            for wave in waves:
                known = ready, cleaned, moved, noise, quiet, pieces, numbers
                tasks = [_Task(design, each[0], *known, k, (ends[k], effort.seed)) for k in wave]
                for place, report in share(_work, tasks):
                    done[wave[place]] = _as_sure_as(report, parts[wave[place]], done)
                    if progress:
                        progress(f"{' and '.join(report.exits)} done", len(done) / sum(map(len, waves)))
                for report in (done[k] for k in wave):
                    noise |= dict(zip(report.exits, report.noise, strict=True))
                    _clean(cleaned, moved, ready, report)
    except KeyboardInterrupt:
        left = [parts[k] for wave in waves for k in wave if k not in done]
        raise Interrupted(_cut_short(left, done, words, time.monotonic() - begin)) from None
    return _answer([done[k] for k in sorted(done)], words, time.monotonic() - begin)


def _columns(logs: int) -> tuple[dict[str, Array], ...]:
    """Per log, columns by name: none yet."""
    return tuple({} for _ in range(logs))


def _as_sure_as(report: SegmentReport, part: Segment, done: Mapping[int, SegmentReport]) -> SegmentReport:
    """The report of a segment, nothing certain where what drives it is written by a segment that is not explained:
    its column is cleaned by a wrong model, which the next effect may have to undo."""
    told = {one.signal for other in done.values() for one in other.unexplained}
    if not told & set(part.entries):
        return report
    return replace(report, missing=tuple(replace(one, certain=False) for one in report.missing))


def _cut_short(
    left: Sequence[Segment], done: Mapping[int, SegmentReport], words: tuple[str, ...], seconds: float
) -> Diagnosis:
    """What the finished segments say; adequate is no answer while some are left that were not searched."""
    words += (f"interrupted: not searched at {', '.join(exit for part in left for exit in part.exits)}",)
    found = _answer([done[k] for k in sorted(done)], words, seconds)
    return replace(found, interrupted=True, verdict="missing" if found.verdict == "missing" else "unexplained")


def _configurations(given: str | Sequence[str | None] | None, logs: int) -> Sequence[str | None]:
    """The configuration of each log; raises AnalysisError where there is none, or not one for each."""
    if not logs:
        raise AnalysisError("no log to compare with", advice="give at least one log")
    if given is None or isinstance(given, str):
        return [given] * logs
    if len(given) != logs:
        raise AnalysisError("one configuration per log", found=f"{len(given)} for {logs}")
    return given


def _prepared(loop: Loop, records: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    held = network(resolve(loop)).held_signals
    found, words = [], []
    for record in records:
        check_raster(record, loop.frame)
        marked, said = with_staircases_held(record)
        found.append(replace(marked, held=marked.held | (held & frozenset(record.names))))
        words.extend(said)
    return tuple(found), tuple(words)


def _check_driven(parts: Sequence[Segment], records: Sequence[Record], loop: Loop) -> None:
    for part in parts:
        for entry in part.entries:
            if entry not in records[0] and entry not in loop.random:
                raise AnalysisError(
                    "the log lacks a signal that drives the loop", where=part.name, found=repr(entry),
                    known=records[0].names, advice="log it, or map a column to it under [log] columns",
                )  # fmt: skip


def _waves(parts: Sequence[Segment], records: Sequence[Record]) -> list[list[int]]:
    """Segments in groups that can run side by side: first those that no other segment's noise reaches."""
    writer = {exit: k for k, part in enumerate(parts) for exit in part.exits}
    noisy = {n for n in records[0].names if column_noise(records[0][n], n in records[0].held) > 0}
    needs = {
        k: {writer[e] for e in p.entries if e in noisy and e in writer} - {k} for k, p in enumerate(parts)
    }
    waves, placed = [], set()
    while len(placed) < len(parts):
        wave = [k for k in needs if k not in placed and needs[k] <= placed]
        if not wave:
            wave = [next(k for k in needs if k not in placed)]
        waves.append(wave)
        placed |= set(wave)
    return waves


def _wanted(waves: list[list[int]], parts: Sequence[Segment], signals: Sequence[str]) -> list[list[int]]:
    """The waves without segments that write none of these signals; all where none is named."""
    if not signals:
        return waves
    left = [[k for k in wave if set(signals) & set(parts[k].exits)] for wave in waves]
    if not any(left):
        known = [exit for part in parts for exit in part.exits]
        raise AnalysisError("no such measured signal", found=", ".join(signals), known=known)
    return [wave for wave in left if wave]


def _ends(waves: Sequence[Sequence[int]], begin: float, effort: Effort) -> dict[int, float]:
    """When the search of each segment ends (s, monotonic clock); what is kept for those that wait is theirs."""
    many = max(effort.processes, 1)
    rounds = [wave[k : k + many] for wave in waves for k in range(0, len(wave), many)]
    kept = min(WAITING, 0.5 * SEARCHED / len(rounds))
    shares = {k: SEARCHED - kept * after for after, wave in enumerate(reversed(rounds)) for k in wave}
    return {k: begin + share * effort.budget for k, share in shares.items()}


def _clean(
    cleaned: tuple[dict[str, Array], ...],
    moved: tuple[dict[str, Array], ...],
    records: Sequence[Record],
    report: SegmentReport,
) -> None:
    for log, record in enumerate(records):
        for j, exit in enumerate(report.exits):
            noise = report.noise[j]
            if exit not in record.held and noise.rms > EXACT * float(np.std(record[exit])):
                fitted = report.outputs[log][:, j]
                cleaned[log][exit] = fitted + wiener_part(record[exit] - fitted, noise)
                moved[log][exit] = report.directions[log][:, j]


@np.errstate(over="ignore", invalid="ignore")  # hypotheses run away: whoever reads them asks what is finite
def _work(task: _Task) -> SegmentReport:
    loop = build(task.design, task.configuration)
    parts = segments(loop, set(task.records[0].names))
    part = parts[task.index]
    free = tolerances(task.design, loop)
    at_rest = frozenset(
        name for name in network(resolve(loop)).held_signals if abs(float(task.records[0].time[0])) < 1e-9
    )
    logged = as_logged(prepared_case(part, task.records, free, at_rest), task.design, task.pieces, task.numbers)
    readers = (one for one in parts if set(one.entries) & set(part.exits))
    logged = replace(logged, read_by=frozenset(exit for one in readers for exit in one.exits))
    cleaned = tuple({**own, **done} for own, done in zip(task.quiet[0], task.cleaned, strict=True))
    columns = cleaned, task.moved, {**task.quiet[1], **task.noise}, set(loop.writers)
    case, noises = driven_best(logged, *columns)
    deadline, seed = task.limits
    found = search(case, Carried(noises, seed), deadline=deadline)
    noisy = [entry for entry in part.entries if entry in task.cleaned[0]]
    if noisy and found.fitted.added and not found.exhausted and not any(found.case.lost.values()):
        other, then = driven_best(logged, *columns, under=found.fitted)  # a dead zone may have kept the noise back
        if other.smooth != case.smooth or any((noises[entry] == 0) != (then[entry] == 0) for entry in noisy):
            again = search(other, Carried(then, seed), deadline=deadline)
            if _rest(again) < _rest(found):
                case, noises, found = other, then, again
    found = begun_again(found, case, Carried(noises, seed), deadline=deadline)
    return segment_report(found)


def _rest(found: Finding) -> float:
    """How much a finding leaves of its exits, in log: the mean over these of the rest's spread."""
    case, fitted = found.case, found.fitted
    rows = zip(case.measured, case.outputs(fitted.added, fitted.values), strict=True)
    left = np.concatenate([m - y for m, y in rows])
    return float(np.mean(np.log(np.maximum(left.std(axis=0), 1e-300))))


def _answer(reports: list[SegmentReport], words: tuple[str, ...], seconds: float) -> Diagnosis:
    missing = tuple(one for report in reports for one in report.missing)
    unexplained = tuple(one for report in reports for one in report.unexplained)
    verdict = "unexplained" if unexplained else "missing" if missing else "adequate"
    ladder = _ladder(reports)
    return Diagnosis(
        verdict=verdict,
        missing=missing,
        ranking={report.exits[0]: report.ranking for report in reports},
        confusable=tuple(one for report in reports for one in report.confusable),
        ladder=tuple(step for step, _ in ladder),
        ladder_bands=tuple(band for _, band in ladder),
        unexplained=unexplained,
        next_experiment=max(
            (one for report in reports if (one := report.next_experiment) is not None),
            key=lambda one: one.expected_delta_chi2,
            default=None,
        ),
        tolerated=_tolerated(reports),
        notes=(*words, *(note for report in reports for note in report.notes)),
        budget_exhausted=any(report.exhausted for report in reports),
        seconds=seconds,
    )


def _tolerated(reports: list[SegmentReport]) -> dict[str, Quantity]:
    """Fitted values by path; of one that several segments fit, the mean weighted by their variances."""
    found: dict[str, list[Quantity]] = {}
    for report in reports:
        for path, one in report.tolerated.items():
            found.setdefault(path, []).append(one)
    return {path: _mean(ones) for path, ones in found.items()}


def _mean(found: Sequence[Quantity]) -> Quantity:
    sure = [one for one in found if math.isfinite(one.std) and one.std > 0]
    if len(found) == 1 or not sure:
        return found[0]
    weights = np.array([one.std**-2.0 for one in sure])
    value = float(weights @ np.array([one.value for one in sure]) / weights.sum())
    return replace(sure[0], value=value, std=float(weights.sum() ** -0.5))


def _ladder(reports: list[SegmentReport]) -> tuple[tuple[Step, Band], ...]:
    """The segments' ladders as one: first all as designed, then all with tolerances fitted, then effect by effect."""
    if not reports:
        return ()
    known: tuple[Step, Band] = Step("as designed", {}, {}), {}
    for report in reports:
        known = _with(known, report.steps[0])
    found = [known]
    fitted = [rung for report in reports for rung in report.steps[1:] if rung[0].step == "tolerances fitted"]
    for rung in fitted:
        known = _with(known, rung)
    found += [known] if fitted else []
    for rung in (r for report in reports for r in report.steps[1:] if r[0].step != "tolerances fitted"):
        known = _with(known, rung)
        found.append(known)
    return tuple(found)


def _with(known: tuple[Step, Band], rung: tuple[Step, Band]) -> tuple[Step, Band]:
    """The rung of all signals with what one segment's rung says of its own."""
    before, new = known[0], rung[0]
    errors, white = {**before.errors, **new.errors}, {**before.whitened, **new.whitened}
    return Step(new.step, errors, white), {**known[1], **rung[1]}
