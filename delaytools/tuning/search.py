"""From several starts to the best values, by turns: solve the program, ask the exact loop, move the regions."""

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from delaytools.tuning.bench import Bench
from delaytools.tuning.goals import MarginGoal, Wishes
from delaytools.tuning.problem import Problem, Solution, solve
from delaytools.tuning.verdict import Figure, figures

__all__ = ["Candidate", "Search"]

_ROUNDS = 6


@final
@dataclass(frozen=True)
class Candidate:
    """Values, the figure of every goal with them, the program's cost, and whether the bench is stable."""

    values: dict[str, float]
    figures: tuple[Figure, ...]
    cost: float
    stable: bool

    @property
    def rank(self) -> tuple[bool, float, float]:
        """Stable first; then how much is missing of all goals, in parts of what is wished; then the cost."""
        return not self.stable, sum(max(0.0, 1 - 1e-3 - f.share) for f in self.figures), self.cost


@final
@dataclass(frozen=True)
class Search:
    """A bench, what is wished of it, and the program made of both."""

    bench: Bench
    wishes: Wishes
    program: Problem

    def best(self, starts: list[list[float]]) -> Candidate:
        """The best stable candidate over all starts, its regions adjusted until the exact margins are as wished."""
        margins = [goal for goal in self.wishes.goals if isinstance(goal, MarginGoal)]
        ones = [1.0] * len(margins)
        found = sorted((solve(self.program, start, ones) for start in starts), key=_price)
        seen: list[tuple[Solution, Candidate]] = []
        for solution in found:
            if all(np.max(np.abs(solution.values - other.values)) > 1e-4 * self._span for other, _ in seen):
                seen.append((solution, self.judged(solution)))
            if seen[-1][1].stable:
                break
        solution, candidate = min(seen, key=lambda pair: pair[1].rank)
        return self._adjusted(solution, candidate, margins) if margins else candidate

    @property
    def _span(self) -> float:
        return float(np.min(self.program.high - self.program.low))

    def judged(self, solution: Solution) -> Candidate:
        """The values with the exact figure of every goal at the ends of its ranges."""
        values = dict(zip(self.wishes.vary, solution.values.tolist(), strict=True))
        found = figures(self.bench, self.wishes, values, points=2)
        stable = self.bench.margins({**self.bench.nominal, **values}).stable
        return Candidate(values, found, solution.cost, stable)

    def _adjusted(self, solution: Solution, best: Candidate, margins: list[MarginGoal]) -> Candidate:
        """The best of some rounds with enlarged or shrunk regions."""
        tighter, too_much, current = [1.0] * len(margins), [math.inf] * len(margins), best
        for _ in range(_ROUNDS):
            places = [self.program.bounded.index(goal) for goal in margins]
            shares = [current.figures[self.wishes.goals.index(goal)].share for goal in margins]
            stands = zip(shares, solution.slack[places], solution.nearest[places], strict=True)
            reach = [_Reach(*stand) for stand in stands]
            too_much = [min(m, t) if r.beyond else m for m, t, r in zip(too_much, tighter, reach, strict=True)]
            new = [r.next(t, m) for r, t, m in zip(reach, tighter, too_much, strict=True)]
            if max(abs(a / b - 1) for a, b in zip(new, tighter, strict=True)) < 5e-3:
                break
            tighter = new
            solution = solve(self.program, solution.values.tolist(), tighter)
            current = self.judged(solution)
            best = min(best, current, key=lambda c: c.rank)
        return best


@final
@dataclass(frozen=True)
class _Reach:
    """How a margin goal stands after a run: share of the wish reached, slack used, smallest constraint."""

    share: float
    slack: float
    nearest: float

    @property
    def beyond(self) -> bool:
        """Whether the region was larger than can be kept clear."""
        return self.slack > 1e-4

    def next(self, tighter: float, too_much: float) -> float:
        """The enlargement to try next: what brings the exact margin to the wish, or else as near as can be reached."""
        if self.beyond:
            return tighter * float(np.clip(self.share, 0.3, 0.95))
        if self.share >= 1 and self.nearest > 1e-4:
            return tighter
        wanted = tighter * float(np.clip(1 / max(self.share, 1e-3), 0.7, 1.4))
        return min(wanted, math.sqrt(tighter * too_much))


def _price(solution: Solution) -> float:
    return solution.cost + 100 * float(solution.slack.sum())
