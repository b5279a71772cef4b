"""What a set of values is worth: every goal by the exact loops, not by the program that found them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from delaytools.tuning.bench import Bench, noisy_blocks
from delaytools.tuning.goals import BandError, Goal, MarginGoal, NoiseGain, Wishes
from delaytools.tuning.problem import band_grid, scenarios

__all__ = ["Figure", "GoalOutcome", "figures", "outcomes"]


@final
@dataclass(frozen=True)
class Figure:
    """A goal's figure and where in its ranges it is worst; `share` = how much of the wish is reached (1 = met)."""

    value: float
    share: float
    worst: Mapping[str, float]


@final
@dataclass(frozen=True)
class GoalOutcome:
    """A goal after tuning: figure, the figure before, what was wanted, whether it is met and by how much not.

    met: None where the goal only asks for as little as possible. worst: the values in `over` at the worst place.
    unit: "rad" for phase margins, else without unit. words: all this in one sentence.
    """

    goal: str
    figure: float
    before: float
    wanted: float | None
    met: bool | None
    missing: float
    unit: str
    worst: Mapping[str, float]
    words: str


def figures(bench: Bench, wishes: Wishes, values: Mapping[str, float], points: int = 5) -> tuple[Figure, ...]:
    """The figure of every goal with these values, at `points` values of each range in `over`."""
    return tuple(_figure(bench, wishes, goal, values, points) for goal in wishes.goals)


def _figure(bench: Bench, wishes: Wishes, goal: Goal, values: Mapping[str, float], points: int) -> Figure:
    places = [{**bench.nominal, **place, **values} for place in scenarios(goal.over, points)]
    named = scenarios(goal.over, points)
    if isinstance(goal, MarginGoal):
        sizes = [goal.size(bench.margins(place)) for place in places]
        worst = int(np.argmin(sizes))
        return Figure(goal.shown(sizes[worst]), sizes[worst] / goal.least_size, named[worst])
    if isinstance(goal, NoiseGain):
        paths = list(wishes.vary)
        gain = float(noisy_blocks(bench.loop, paths, goal.of)(ca.DM([values[path] for path in paths])))
        return Figure(gain, goal.most / max(gain, 1e-12), {})
    assert isinstance(goal, BandError)
    errors = [float(np.mean(bench.error(place, band_grid(goal)))) for place in places]
    mean = float(np.mean(errors))
    share = 1.0 if goal.most is None else goal.most / max(mean, 1e-300)
    return Figure(mean, share, named[int(np.argmax(errors))] if goal.over else {})


def outcomes(goals: Sequence[Goal], before: Sequence[Figure], after: Sequence[Figure]) -> tuple[GoalOutcome, ...]:
    """The goals with their figures before and after."""
    return tuple(_outcome(*item) for item in zip(goals, before, after, strict=True))


def _outcome(goal: Goal, before: Figure, after: Figure) -> GoalOutcome:
    wanted = goal.least if isinstance(goal, MarginGoal) else getattr(goal, "most", None)
    unit = goal.unit if isinstance(goal, MarginGoal) else ""
    met = None if wanted is None else after.share >= 1 - 1e-3
    missing = 0.0 if wanted is None or met else abs(wanted - after.value)
    words = _words(goal, (before.value, after.value, wanted), met, after.worst)
    return GoalOutcome(goal.kind, after.value, before.value, wanted, met, missing, unit, after.worst, words)


def _words(
    goal: Goal, numbers: tuple[float, float, float | None], met: bool | None, worst: Mapping[str, float]
) -> str:
    degrees = isinstance(goal, MarginGoal) and goal.unit == "rad"
    factor, unit = (180 / math.pi, " deg") if degrees else (1.0, "")
    before, after, wanted = (None if x is None else factor * x for x in numbers)
    name = goal.kind.replace("_", " ")
    where = ", ".join(f"{path} = {value:.4g}" for path, value in worst.items())
    text = f"{name} {before:.4g} -> {after:.4g}{unit}" + (f" (worst at {where})" if where else "")
    if wanted is None:
        return text
    bound = "at least" if isinstance(goal, MarginGoal) else "at most"
    verdict = "met" if met else f"not met, {abs(wanted - after):.3g}{unit} short of it"  # type: ignore[operator]
    return f"{text}; {bound} {wanted:.4g}{unit} wanted: {verdict}"
