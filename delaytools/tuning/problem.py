"""Goals → one nonlinear program on a frequency grid, with exact delays and exact derivatives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.tuning.bench import Bench, noisy_blocks
from delaytools.tuning.goals import BandError, Goal, MarginGoal, NoiseGain, Range, Wishes

__all__ = ["Problem", "Solution", "band_grid", "problem", "scenarios", "solve"]

RealArray = NDArray[np.float64]
_PENALTY = 100.0  # of a unit of violation, against a band error that is of the order 0.01 to 1
_SNAP = 1e-4  # of a range: nearer to an end than an interior-point method tells apart from the end itself
_IPOPT: dict[str, Any] = {
    "ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.max_iter": 200, "ipopt.tol": 1e-9,
    "ipopt.hessian_approximation": "limited-memory", "error_on_fail": False,
}  # fmt: skip


@final
@dataclass(frozen=True)
class Problem:
    """min f(x, t) with g(x, t) >= 0; x = [z; s], z the varied values scaled to 0..1, s >= 0 a slack per bound.

    t: how many times each margin goal's region is enlarged. low, high: of the varied values. bounded: the goals
    with a slack, in order. rows: the rows of g that belong to each. formulas: (x, t) -> (f, g).
    """

    formulas: ca.Function
    solver: ca.Function
    low: RealArray
    high: RealArray
    bounded: tuple[Goal, ...]
    rows: tuple[slice, ...]


@final
@dataclass(frozen=True)
class Solution:
    """values (n,) of what varies, cost without penalties, slack and smallest constraint of each bounded goal."""

    values: RealArray
    cost: float
    slack: RealArray
    nearest: RealArray
    status: str


def scenarios(over: Mapping[str, Range], points: int) -> list[dict[str, float]]:
    """The corners and what lies between them: every combination of `points` values per range."""
    axes = [np.linspace(low, high, points).tolist() for low, high in over.values()]
    return [dict(zip(over, combination, strict=True)) for combination in product(*axes)]


def band_grid(goal: BandError, points: int = 60) -> RealArray:
    """Frequencies in rad/s, evenly spaced in log ω over the goal's band."""
    return np.asarray(2 * np.pi * np.geomspace(*goal.band, points))


def problem(bench: Bench, wishes: Wishes, omega: RealArray) -> Problem:
    """The program for the wishes; margins are kept on the grid `omega` (n,) rad/s."""
    low, high = (np.array([r[i] for r in wishes.vary.values()], dtype=float) for i in (0, 1))
    bounded = tuple(goal for goal in wishes.goals if not (isinstance(goal, BandError) and goal.most is None))
    z, s = ca.MX.sym("z", len(low)), ca.MX.sym("s", len(bounded))
    t = ca.MX.sym("t", sum(isinstance(goal, MarginGoal) for goal in wishes.goals))
    varied = dict(zip(wishes.vary, ca.vertsplit(ca.DM(low) + z * ca.DM(high - low)), strict=True))
    model = _Model(bench, varied, bench.response(), bench.flight_response(), omega)
    cost, kept = _cost(model, wishes, z, low, high), []
    margins = [goal for goal in wishes.goals if isinstance(goal, MarginGoal)]
    for goal in bounded:
        kept.append(model.bound(goal, t[margins.index(goal)] if isinstance(goal, MarginGoal) else ca.MX(1)))
    ends = np.cumsum([0, *(part.shape[0] for part in kept)])
    rows = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
    x, f = ca.vertcat(z, s), cost + _PENALTY * ca.sum1(s)
    g = ca.vertcat(*[part + s[i] for i, part in enumerate(kept)])
    formulas = ca.Function("goals", [x, t], [f, g])
    program: dict[str, Any] = {"x": x, "p": t, "f": f, "g": g}
    solver = ca.nlpsol("tune", "ipopt", program, _IPOPT)
    return Problem(formulas, solver, low, high, bounded, rows)


def _cost(model: "_Model", wishes: Wishes, z: ca.MX, low: RealArray, high: RealArray) -> ca.MX:
    """The weighted band errors; where there is none, the distance from the values that stand there now."""
    errors = [goal for goal in wishes.goals if isinstance(goal, BandError)]
    if errors:
        return ca.sum1(ca.vertcat(*[goal.weight * model.error(goal) for goal in errors]))
    now = np.array([model.bench.nominal[path] for path in wishes.vary])
    return ca.sumsqr(z - ca.DM((now - low) / (high - low)))


@final
@dataclass(frozen=True)
class _Model:
    bench: Bench
    varied: dict[str, ca.MX]
    response: ca.Function
    flying: ca.Function
    omega: RealArray

    def _p(self, scenario: Mapping[str, float]) -> ca.MX:
        known: dict[str, Any] = {**self.bench.nominal, **scenario, **self.varied}
        return ca.vertcat(*[known[path] for path in self.bench.paths])

    def _curve(self, function: ca.Function, p: ca.MX, omega: RealArray) -> tuple[ca.MX, ca.MX]:
        n = len(omega)
        re, im = function.map(n)(ca.DM(omega).T, ca.repmat(p, 1, n))
        return re.T, im.T

    def error(self, goal: BandError) -> ca.MX:
        """The mean of |L/L_flight - 1|² over the band and the scenarios."""
        omega, found = band_grid(goal), []
        for scenario in scenarios(goal.over, 3):
            p = self._p(scenario)
            (a, b), (c, d) = self._curve(self.response, p, omega), self._curve(self.flying, p, omega)
            found.append(ca.sum1(((a - c) ** 2 + (b - d) ** 2) / (c**2 + d**2)) / len(omega))
        return ca.sum1(ca.vertcat(*found)) / len(found)

    def bound(self, goal: Goal, tighter: ca.MX) -> ca.MX:
        """What must be >= 0, between -1 and 1/2 or so."""
        match goal:
            case MarginGoal():
                parts = []
                for scenario in scenarios(goal.over, 3):
                    q = goal.outside(*self._curve(self.response, self._p(scenario), self.omega), tighter)
                    parts.append(q / (1 + q) - 0.5)
                return ca.vertcat(*parts)
            case NoiseGain():
                gain = noisy_blocks(self.bench.loop, list(self.varied), goal.of)
                return 1 - gain(ca.vertcat(*self.varied.values())) / goal.most
            case BandError(most=most) if most is not None:
                return 1 - self.error(goal) / most
        raise AssertionError(goal)


def solve(program: Problem, values: Sequence[float], tighter: Sequence[float]) -> Solution:
    """One run of IPOPT from `values`, each margin goal's region enlarged `tighter` times."""
    n, count = len(program.low), len(program.bounded)
    z = np.clip((np.asarray(values, dtype=float) - program.low) / (program.high - program.low), 0.0, 1.0)
    start = np.append(z, np.ones(count))
    upper = np.append(np.ones(n), np.full(count, np.inf))
    rows = program.formulas.size1_out(1)
    answer = program.solver(
        x0=start, p=list(tighter), lbx=np.zeros(n + count), ubx=upper, lbg=np.zeros(rows), ubg=np.full(rows, np.inf)
    )
    x = np.asarray(answer["x"]).ravel()
    z = np.clip(np.where(np.abs(x[:n] - np.round(x[:n])) < _SNAP, np.round(x[:n]), x[:n]), 0.0, 1.0)
    slack = np.maximum(x[n:], 0.0)
    g = np.asarray(answer["g"]).ravel()
    nearest = np.array([g[r].min(initial=np.inf) - s for r, s in zip(program.rows, slack, strict=True)])
    found = np.where(z == 1.0, program.high, program.low + z * (program.high - program.low))
    cost = float(answer["f"]) - _PENALTY * float(slack.sum())
    return Solution(found, cost, slack, nearest, str(program.solver.stats()["return_status"]))
