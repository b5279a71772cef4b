"""Everything the report shows, computed: the verbs are called here, and nothing is drawn."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar, final

from delaytools.design.design import Design
from delaytools.report.assumptions import Remark, remarks
from delaytools.report.budget import Budget, budget
from delaytools.report.cases import Asked, Case, asked, cases
from delaytools.report.compensation import Compensation, compensations
from delaytools.report.cycles import CycleCurve, cycle_curve
from delaytools.report.delay_curves import DelayCurve, delay_curve, delay_range, families
from delaytools.report.diagram_layout import Diagram, layout
from delaytools.report.diagram_parts import diagram_parts
from delaytools.report.evidence import Evidence, Improvement, improvement
from delaytools.report.locus import Locus, locus
from delaytools.report.nyquist import NyquistCurve, nyquist_curve
from delaytools.report.runs import Run, Runs, run_case, shown_signals
from delaytools.report.verdict import MarginRow, Verdict, verdict
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["Contents", "Progress", "Trouble", "gather"]

Progress = Callable[[str], None]
Answer = TypeVar("Answer")
NYQUIST = 5  # loops drawn, flight besides


@final
@dataclass(frozen=True)
class Trouble:
    """A question that could not be answered: the section's key, and the words of the error."""

    section: str
    words: str


@final
@dataclass(frozen=True)
class Contents:
    """The answers; empty or None where the design leaves something out or `troubles` says why."""

    design: Design
    asked: Asked
    cases: tuple[Case, ...]
    diagram: Diagram | None
    verdict: Verdict | None
    budgets: tuple[Budget, ...]
    span: tuple[float, float]
    curves: tuple[DelayCurve, ...]
    nyquist: tuple[NyquistCurve, ...]
    loci: tuple[Locus, ...]
    cycles: tuple[CycleCurve, ...]
    runs: Runs | None
    compensations: tuple[Compensation, ...]
    remarks: tuple[Remark, ...]
    evidence: Evidence | None
    improvement: Improvement | None
    troubles: tuple[Trouble, ...]


@final
class _Tries:
    """Calls that may fail: errors of the design's making are kept for the report, others are not caught."""

    def __init__(self, progress: Progress) -> None:
        self.progress, self.found = progress, list[Trouble]()

    def __call__(self, section: str, what: str, call: Callable[[], Answer]) -> Answer | None:
        self.progress(what)
        try:
            return call()
        except DelaytoolsError as error:
            self.found.append(Trouble(section, f"{what}: {error}"))
            return None


def gather(
    design: Design,
    progress: Progress,
    extra: tuple[Compensation, ...] = (),
    evidence: Evidence | None = None,
) -> Contents:
    """All answers for the design; `extra`: compensations found elsewhere (by tuning). evidence: what logs say of it.

    Raises DesignError where the design itself cannot be built.
    """
    questions, every, tries = asked(design), cases(design), _Tries(progress)
    removed = frozenset(design.tables.flight.remove)
    at = questions.at
    diagram = tries("diagram", "block diagram", lambda: layout(diagram_parts(design), at))
    answer = tries("margins", "margins", partial(verdict, every, questions)) if at else None
    span = (0.0, 0.0)
    budgets: tuple[Budget, ...] = ()
    curves: tuple[DelayCurve, ...] = ()
    nyquist: tuple[NyquistCurve, ...] = ()
    loci: tuple[Locus, ...] = ()
    cycles: tuple[CycleCurve, ...] = ()
    if answer is not None:
        budgets = _kept(
            tries("budget", f"budget of {c.name}", partial(budget, c, at, answer[c.name].bench, removed))
            for c in every
        )
        span = delay_range(questions, [row.bench for row in answer.rows])
        curves = _kept(
            tries("sweep", f"margins against delay, {f.name}", partial(delay_curve, f, questions, span))
            for f in families(every, questions)
        )
        nyquist = tries("nyquist", "Nyquist curves", partial(_nyquist, every, answer, at)) or ()
        loci = _loci(tries, curves, answer, questions, span)
        cycles = _kept(
            tries("cycles", f"limit cycles, {c.family.name}", partial(cycle_curve, c, questions, span)) for c in curves
        )
    runs = _runs(tries, design, every, questions)
    found = compensations(design, answer) if answer is not None else ()
    better = None
    if evidence is not None and evidence.diagnosis is not None and at:
        better = tries("missing", "margins with what is missing", partial(improvement, design, evidence, at))
    return Contents(
        design, questions, every, diagram, answer, budgets, span, curves, nyquist, loci, cycles, runs,
        (*found, *extra), remarks(design), evidence, better, tuple(tries.found),
    )  # fmt: skip


def _kept(answers: Iterable[Answer | None]) -> tuple[Answer, ...]:
    return tuple(answer for answer in answers if answer is not None)


def _loci(
    tries: _Tries,
    curves: tuple[DelayCurve, ...],
    answer: Verdict,
    questions: Asked,
    span: tuple[float, float],
) -> tuple[Locus, ...]:
    """The locus of the family that the weakest stable configuration belongs to."""
    chosen = [c for c in curves if answer.focus.name in dict(c.family.members)]
    return _kept(tries("locus", "root locus", partial(locus, c, questions, span)) for c in chosen)


def main_rows(answer: Verdict) -> tuple[MarginRow, ...]:
    """The rows that matter most: the first, the weakest, the optimistic ones, then the others by their weakness."""
    ranked = sorted(answer.rows, key=lambda row: row.bench.modulus_margin or 0.0)
    order = [answer.rows[0], answer.focus, answer.weakest]
    order += [row for row in answer.rows if row.judgement == "optimistic"] + ranked
    chosen: list[MarginRow] = []
    for row in order:
        numbers = [(r.bench.modulus_margin, r.bench.crossings) for r in chosen]
        if row not in chosen and (row.bench.modulus_margin, row.bench.crossings) not in numbers:
            chosen.append(row)
    return tuple(row for row in answer.rows if row in chosen[:NYQUIST])


def _nyquist(every: tuple[Case, ...], answer: Verdict, at: str) -> tuple[NyquistCurve, ...]:
    by_name = {case.name: case for case in every}
    curves = [nyquist_curve(by_name[row.name].loop, at, row.name, row.bench) for row in main_rows(answer)]
    focus = answer.focus
    flies = by_name[focus.name].flight
    if flies is not None and focus.flight is not None:
        curves.append(nyquist_curve(flies, at, focus.name, focus.flight, flies=True))
    return tuple(curves)


def _runs(tries: _Tries, design: Design, every: tuple[Case, ...], questions: Asked) -> Runs | None:
    if not design.tables.inputs:
        return None
    signals, demand = shown_signals(design, every[0].loop, questions)
    wanted = (*signals, *(name for name in demand if name))
    found: tuple[Run, ...] = _kept(
        tries("runs", f"run of {case.name}", partial(run_case, design, case, wanted)) for case in every
    )
    units = dict(every[0].loop.units)
    return Runs(found, signals, demand, units, design.tables.simulation.seed) if found else None
