"""Which physical effect is missing: logs against a design, segment by segment."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.design.build import build
from delaytools.design.design import Design
from delaytools.design.tolerance import tolerances
from delaytools.diagnosis.answer import Diagnosis, Step
from delaytools.diagnosis.case import Case, prepared_case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.noise import wiener_part
from delaytools.diagnosis.noise_of import carried_noise, column_noise, noise_of
from delaytools.diagnosis.search import search
from delaytools.diagnosis.segment_report import SegmentReport, segment_report
from delaytools.loop.loop import Loop
from delaytools.loop.network import network
from delaytools.loop.segments import Segment, segments
from delaytools.loop.values import resolve
from delaytools.measurement.staircase import with_staircases_held
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError

__all__ = ["diagnose"]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
BUDGET = 170.0  # s


@final
@dataclass(frozen=True, eq=False)
class _Task:
    """One segment for one process; cleaned: per log, columns without the noise of their pick-off.

    moved: per log, what a standard error of each fitted value does to these columns, (n, k).
    """

    design: Design
    configuration: str | None
    records: tuple[Record, ...]
    cleaned: tuple[dict[str, Array], ...]
    moved: tuple[dict[str, Array], ...]
    index: int
    deadline: float


def diagnose(
    design: Design,
    records: Sequence[Record],
    *,
    configuration: str | None = None,
    seed: int = 1,
    progress: Progress | None = None,
    processes: int = 2,
    budget: float = BUDGET,
) -> Diagnosis:
    """What the design lacks, by logs of runs that it should explain.

    Each segment between measured signals is driven by what was measured at its entries. Candidates are the catalogue
    at every port and every value of its blocks; each is fitted together with what [tolerance] leaves free, and judged
    on time blocks (or logs) that were not used for its fit. progress: called with words and the share done. budget: s
    after which no new search begins; then `budget_exhausted`. The same logs give the same answer.
    Raises DelaytoolsError for a log that lacks what drives a segment.
    """
    begin = time.monotonic()
    loop = build(design, configuration)
    ready, words = _prepared(loop, records)
    parts = segments(loop, set(ready[0].names))
    _check_driven(parts, ready, loop)
    cleaned: tuple[dict[str, Array], ...] = tuple({} for _ in ready)
    moved: tuple[dict[str, Array], ...] = tuple({} for _ in ready)
    done: dict[int, SegmentReport] = {}
    with _pool(processes) as pool:
        for wave in _waves(parts, ready):
            tasks = [_Task(design, configuration, ready, cleaned, moved, k, begin + budget) for k in wave]
            for k, report in zip(wave, pool(_work, tasks), strict=True):
                done[k] = report
                _clean(cleaned, moved, ready, report)
                if progress:
                    progress(f"{' and '.join(report.exits)} done", len(done) / len(parts))
    return _answer([done[k] for k in range(len(parts))], words, time.monotonic() - begin)


def _prepared(loop: Loop, records: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    if not records:
        raise AnalysisError("no log to compare with", advice="give at least one log")
    held = network(resolve(loop)).held_signals
    found, words = [], []
    for record in records:
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


def _pool(processes: int) -> "_Pool":
    return _Pool(processes)


@final
class _Pool:
    """map over processes, or in this one where one is enough."""

    def __init__(self, processes: int) -> None:
        self._processes = processes
        self._executor: ProcessPoolExecutor | None = None

    def __enter__(self) -> "Callable[..., Sequence[SegmentReport]]":
        if self._processes > 1:
            self._executor = ProcessPoolExecutor(self._processes, mp_context=get_context("spawn"))
            return lambda work, tasks: list(self._executor.map(work, tasks))  # type: ignore[union-attr]
        return lambda work, tasks: [work(task) for task in tasks]

    def __exit__(self, *exc: object) -> None:
        if self._executor:
            self._executor.shutdown(cancel_futures=True)


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


def _clean(
    cleaned: tuple[dict[str, Array], ...],
    moved: tuple[dict[str, Array], ...],
    records: Sequence[Record],
    report: SegmentReport,
) -> None:
    for log, record in enumerate(records):
        for j, exit in enumerate(report.exits):
            noise = column_noise(record[exit], exit in record.held)
            if noise > 0:
                fitted = report.outputs[log][:, j]
                cleaned[log][exit] = fitted + wiener_part(record[exit] - fitted, noise)
                moved[log][exit] = report.directions[log][:, j]


def _work(task: _Task) -> SegmentReport:
    loop = build(task.design, task.configuration)
    part = segments(loop, set(task.records[0].names))[task.index]
    free = tolerances(task.design, loop)
    at_rest = frozenset(
        name for name in network(resolve(loop)).held_signals if abs(float(task.records[0].time[0])) < 1e-9
    )
    case, noises = _driven_best(prepared_case(part, task.records, free, at_rest), task.cleaned, task.moved)
    carried = carried_noise(case, _nominal(case), noises)
    return segment_report(search(case, carried, deadline=task.deadline))


def _nominal(case: Case) -> Fitted:
    parameters = case.parameters(())
    return Fitted((), parameters, np.zeros(0), np.zeros((0, len(parameters))))


def _driven_best(
    case: Case, cleaned: tuple[dict[str, Array], ...], moved: tuple[dict[str, Array], ...]
) -> tuple[Case, dict[str, float]]:
    """Each noisy entry as measured or cleaned, whichever leaves less incoherent residual; and the entries' noise."""
    first = case.records[0]
    noises = {n: column_noise(first[n], n in first.held) for n in first.names}
    exact = frozenset(n for n in first.names if noises[n] == 0 and n not in first.held)
    case = replace(case, smooth=exact)
    sources = [n for n in cleaned[0] if n not in case.exits and n not in case.segment.entries]
    case = _with_columns(case, cleaned, sources)
    chosen: list[str] = []
    for entry in (n for n in case.segment.entries if n in cleaned[0]):
        tried = _with_columns(case, cleaned, [entry])
        if _left_over(tried) < _left_over(case):
            case, chosen = tried, [*chosen, entry]
        else:
            noises[entry] = 0.0
    return replace(case, nuisance=_nuisance(case, chosen, moved)), noises


def _nuisance(case: Case, entries: Sequence[str], moved: tuple[dict[str, Array], ...]) -> tuple[Array, ...]:
    """Per log (n, exits, k): the exits' response to each uncertain value of the segments that write the entries."""
    ways = [(entry, k) for entry in entries for k in range(moved[0][entry].shape[1])]
    if not ways:
        return ()
    fitted = _nominal(case)
    base = case.outputs((), fitted.values)
    columns: list[list[Array]] = [[] for _ in base]
    for entry, k in ways:
        shifted = tuple(
            {entry: r[entry] + new[entry][:, k]} for r, new in zip(case.records, moved, strict=True)
        )
        for log, rows in enumerate(_with_columns(case, shifted, [entry]).outputs((), fitted.values)):
            columns[log].append(rows - base[log])
    return tuple(np.stack(found, axis=2) for found in columns)


def _left_over(case: Case) -> float:
    silent = tuple(np.zeros(len(case.records[0])) for _ in case.exits)
    found = noise_of(case, _nominal(case), silent)
    spread = [float(np.std(case.measured[0][:, j])) or 1.0 for j in range(len(found))]
    return float(sum((one.rms / size) ** 2 for one, size in zip(found, spread, strict=True)))


def _with_columns(case: Case, cleaned: tuple[dict[str, Array], ...], names: Sequence[str]) -> Case:
    records = tuple(
        Record(r.time, {**r.columns, **{n: new[n] for n in names}}, r.units, r.held, r.source)
        for r, new in zip(case.records, cleaned, strict=True)
    )
    return replace(case, records=records, smooth=case.smooth | frozenset(names), _replays={})


def _answer(reports: list[SegmentReport], words: tuple[str, ...], seconds: float) -> Diagnosis:
    missing = tuple(one for report in reports for one in report.missing)
    unexplained = tuple(one for report in reports for one in report.unexplained)
    verdict = "unexplained" if unexplained else "missing" if missing else "adequate"
    return Diagnosis(
        verdict=verdict,
        missing=missing,
        ranking={report.exits[0]: report.ranking for report in reports},
        confusable=tuple(one for report in reports for one in report.confusable),
        ladder=_ladder(reports),
        unexplained=unexplained,
        next_experiment=None,
        tolerated={path: value for report in reports for path, value in report.tolerated.items()},
        notes=(*words, *(note for report in reports for note in report.notes)),
        budget_exhausted=any(report.exhausted for report in reports),
        seconds=seconds,
    )


def _ladder(reports: list[SegmentReport]) -> tuple[Step, ...]:
    """The segments' ladders as one: first all as designed, then all with tolerances fitted, then effect by effect."""
    errors = {s: e for report in reports for s, e in report.steps[0].errors.items()}
    white = {s: e for report in reports for s, e in report.steps[0].whitened.items()}
    found = [Step("as designed", dict(errors), dict(white))]
    fitted = [step for report in reports for step in report.steps[1:] if step.step == "tolerances fitted"]
    if fitted:
        for step in fitted:
            errors |= step.errors
            white |= step.whitened
        found.append(Step("tolerances fitted", dict(errors), dict(white)))
    for step in (s for report in reports for s in report.steps[1:] if s.step != "tolerances fitted"):
        errors |= step.errors
        white |= step.whitened
        found.append(Step(step.step, dict(errors), dict(white)))
    return tuple(found)
