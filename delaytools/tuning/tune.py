"""Tune a design: goals → a nonlinear program → values, judged by the exact loops."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.margins import Margins
from delaytools.loop.loop import Loop
from delaytools.signals.trouble import DesignError
from delaytools.tuning.bench import Bench, delay_at_port
from delaytools.tuning.goals import Goal, Range, Wishes
from delaytools.tuning.problem import Problem, problem
from delaytools.tuning.search import Candidate, Search
from delaytools.tuning.verdict import Figure, GoalOutcome, figures, outcomes

__all__ = ["Tuned", "TunedValue", "tune"]


@final
@dataclass(frozen=True)
class TunedValue:
    """A value after and before tuning, in SI or the signal's unit, and whether it lies at the end of its range."""

    value: float
    was: float
    at_boundary: bool


@final
@dataclass(frozen=True)
class Tuned:
    """What tuning found.

    values: path -> value. goals: in the order of the wishes. cost: the weighted band error (or, without such a
    goal, the squared share of the ranges that was moved); was_cost: before. stable: of the bench with these values.
    optimistic: the bench then shows more gain or phase margin than the loop that flies. message: all in words.
    """

    values: Mapping[str, TunedValue]
    goals: tuple[GoalOutcome, ...]
    cost: float
    was_cost: float
    stable: bool
    optimistic: bool
    message: str

    @property
    def met(self) -> bool:
        """Whether every goal with a bound is met and the bench is stable."""
        return self.stable and all(goal.met is not False for goal in self.goals)


def tune(
    loop: Loop, flight: Loop, *, wishes: Wishes, at: str, delay_at: str | None = None, starts: int = 5
) -> Tuned:
    """The values within `wishes.vary` that serve the goals best; both loops are opened at the signal `at`.

    L = -R with exact delays; a sampled loop is searched by its continuous approximation and judged by the exact
    pulse transfer where that exists. `delay` in a goal's `over` is the delay at the port `delay_at`: the one that
    stands there already, or a new one. IPOPT from `starts` points; regions about the critical point are then
    enlarged or shrunk until the exact margins are as wished. Goals that cannot be met are said so, with how much is
    missing. Raises DesignError for unknown paths, ports or signals, or an empty range.
    """
    loop, wishes = _with_delay_path(loop, wishes, delay_at)
    bench = Bench(loop, flight, at, _paths(wishes))
    now = {path: bench.nominal[path] for path in wishes.vary}
    _check(wishes)
    program = problem(bench, wishes, _grid(bench, now, wishes))
    before = figures(bench, wishes, now)
    search = Search(bench, wishes, program)
    best = search.best(_starts(program, list(now.values()), starts))
    return _tuned(search, now, before, best)


def _with_delay_path(loop: Loop, wishes: Wishes, delay_at: str | None) -> tuple[Loop, Wishes]:
    """`delay` in `over` replaced by the path of the delay at the port."""
    if not any("delay" in goal.over for goal in wishes.goals):
        return loop, wishes
    loop, path = delay_at_port(loop, delay_at)
    goals = tuple(_renamed(goal, path) for goal in wishes.goals)
    return loop, Wishes(wishes.vary, goals)


def _renamed(goal: Goal, path: str) -> Goal:
    over = {path if name == "delay" else name: ends for name, ends in goal.over.items()}
    return replace(goal, over=over)  # type: ignore[type-var]


def _paths(wishes: Wishes) -> tuple[str, ...]:
    over = [path for goal in wishes.goals for path in goal.over]
    both = sorted(set(over) & set(wishes.vary))
    if both:
        raise DesignError("a value is either tuned or covered by a goal's range", found=both[0])
    return tuple(dict.fromkeys([*wishes.vary, *over]))


def _check(wishes: Wishes) -> None:
    if not wishes.vary:
        raise DesignError("nothing to tune", where="tuning.vary", advice="name values and their ranges")
    if not wishes.goals:
        raise DesignError("nothing is wished", where="tuning.goals", advice="give a goal, such as band_error")
    ranges: list[tuple[str, Range]] = list(wishes.vary.items())
    for path, (low, high) in ranges:
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise DesignError("a range runs from low to high", where=path, found=f"[{low:g}, {high:g}]")


def _grid(bench: Bench, now: Mapping[str, float], wishes: Wishes) -> NDArray[np.float64]:
    """Frequencies in rad/s for the margins: well around every crossing of bench and flight as they are."""
    found = [bench.flight_margins({**bench.nominal, **now}), bench.margins({**bench.nominal, **now})]
    crossings = [c.frequency for m in found for c in m.crossings if 0 < c.frequency < math.inf]
    low, high = (min(crossings) / 5, max(crossings) * 3) if crossings else (0.1, 1e3)
    count = int(np.clip(60 * math.log10(high / low), 60, 240))
    return np.asarray(np.geomspace(low, high, count))


def _starts(program: Problem, now: Sequence[float], count: int) -> list[list[float]]:
    """What stands there now, the middle, and points spread evenly (by the golden ratio) over the ranges."""
    n, found = len(now), [list(now)]
    for k in range(count - 1):
        shares = np.full(n, 0.5) if k == 0 else np.mod(0.5 + k * 0.6180339887 ** (np.arange(n) + 1.0), 1.0)
        found.append((program.low + shares * (program.high - program.low)).tolist())
    return found


def _tuned(search: Search, now: dict[str, float], before: tuple[Figure, ...], best: Candidate) -> Tuned:
    bench, wishes = search.bench, search.wishes
    values = {
        path: TunedValue(value, now[path], min(abs(value - low), abs(value - high)) < 1e-4 * (high - low))
        for (path, value), (low, high) in zip(best.values.items(), wishes.vary.values(), strict=True)
    }
    reached = figures(bench, wishes, best.values)
    goals = outcomes(wishes.goals, before, reached)
    flying = bench.flight_margins({**bench.nominal, **best.values})
    after = bench.margins({**bench.nominal, **best.values})
    optimistic = after.stable and flying.stable and _more_margin(after, flying)
    costs = (_cost(wishes, values, reached), _cost(wishes, {}, before))
    words = _message(values, goals, after.stable, optimistic)
    return Tuned(values, goals, *costs, after.stable, optimistic, words)


def _more_margin(bench: Margins, flight: Margins) -> bool:
    """Whether the bench shows over 2 % more gain or phase margin than the loop that flies."""
    for name in ("gain_margin", "phase_margin"):
        one, other = getattr(bench, name), getattr(flight, name)
        if one is not None and other is not None and abs(one) > 1.02 * abs(other):
            return True
    return False


def _cost(wishes: Wishes, values: Mapping[str, TunedValue], found: Sequence[Figure]) -> float:
    errors = [
        getattr(goal, "weight", 1.0) * figure.value
        for goal, figure in zip(wishes.goals, found, strict=True)
        if goal.kind == "band_error"
    ]
    if errors:
        return float(sum(errors))
    return float(
        sum(((v.value - v.was) / (wishes.vary[p][1] - wishes.vary[p][0])) ** 2 for p, v in values.items())
    )


def _message(
    values: Mapping[str, TunedValue], goals: Sequence[GoalOutcome], stable: bool, optimistic: bool
) -> str:
    ends = {True: " (at the end of its range)", False: ""}
    parts = [f"{path} {v.was:.5g} -> {v.value:.5g}{ends[v.at_boundary]}" for path, v in values.items()]
    parts += [goal.words for goal in goals]
    if not stable:
        parts.append("the bench is unstable with these values")
    if optimistic:
        parts.append("the bench then shows more margin than the loop that flies: it is optimistic")
    return "; ".join(parts)
