"""Margins of every configuration beside the loop that flies, and the judgement of the bench."""

import math
from dataclasses import dataclass
from typing import final

from delaytools.analysis.margins import Margins
from delaytools.analysis.questions import loop_margins
from delaytools.report.cases import Asked, Case

__all__ = ["MarginRow", "Verdict", "judged", "verdict"]

SAME = 0.005  # margins that differ by less than this share are taken as equal


@final
@dataclass(frozen=True)
class MarginRow:
    """One configuration: margins on the bench and in flight, and in which margins the bench is optimistic.

    judgement: "optimistic", "as flight", "pessimistic", "unstable", "stable" (no flight loop to compare with).
    """

    name: str
    description: str
    bench: Margins
    flight: Margins | None
    judgement: str
    optimistic_in: tuple[str, ...]
    why_approximate: str


@final
@dataclass(frozen=True)
class Verdict:
    """One row for each configuration; `opened` at this signal."""

    opened: str
    rows: tuple[MarginRow, ...]

    @property
    def weakest(self) -> MarginRow:
        """The row nearest to instability on the bench: unstable first, then the smallest modulus margin."""
        return min(self.rows, key=lambda row: row.bench.modulus_margin or 0.0)

    @property
    def focus(self) -> MarginRow:
        """The weakest of the stable rows, which shows most of what delay does; the weakest where none is stable."""
        stable = [row for row in self.rows if row.bench.stable]
        return min(stable, key=lambda row: row.bench.modulus_margin or 0.0) if stable else self.weakest

    def __getitem__(self, name: str) -> MarginRow:
        return next(row for row in self.rows if row.name == name)


def verdict(cases: tuple[Case, ...], asked: Asked) -> Verdict:
    """The margins of each case as the bench stands (no extra delay), next to its flight loop's."""
    return Verdict(asked.at, tuple(_row(case, asked) for case in cases))


def _row(case: Case, asked: Asked) -> MarginRow:
    sweep = loop_margins(case.loop, asked.at)
    bench = sweep.margins[0]
    flies = None if case.flight is None else loop_margins(case.flight, asked.at).margins[0]
    word, where = judged(bench, flies)
    return MarginRow(case.name, case.description, bench, flies, word, where, sweep.why_approximate)


def judged(bench: Margins, flies: Margins | None) -> tuple[str, tuple[str, ...]]:
    """(judgement, margins in which the bench has more than flight)."""
    if flies is None:
        return ("stable" if bench.stable else "unstable"), ()
    if not flies.stable:
        return ("optimistic", ("stability",)) if bench.stable else ("unstable", ())
    if not bench.stable:
        return "unstable", ()
    pairs = list(zip(_sizes(bench).items(), _sizes(flies).values(), strict=True))
    more = tuple(name for (name, size), other in pairs if size > other * (1 + SAME))
    if more:
        return "optimistic", more
    less = any(size < other * (1 - SAME) for (_, size), other in pairs)
    return ("pessimistic" if less else "as flight"), ()


def _sizes(margins: Margins) -> dict[str, float]:
    """How far each margin is from none: the larger the better."""
    gain = abs(math.log(margins.gain_margin)) if margins.gain_margin else math.inf
    phase = math.inf if margins.phase_margin is None else abs(margins.phase_margin)
    delay = math.inf if margins.delay_margin is None else margins.delay_margin
    modulus = math.inf if margins.modulus_margin is None else margins.modulus_margin
    return {"gain margin": gain, "phase margin": phase, "delay margin": delay, "modulus margin": modulus}
