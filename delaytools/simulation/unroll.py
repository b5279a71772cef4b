"""One call of the compiled loop: several spans unrolled into one CasADi function.

State of a call: x, v (held outputs), k (kept states), w (followers), and the history of what enters each delay,
four numbers per span: value and scaled derivative at its start and at its end (a cubic Hermite piece).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.simulation.physics import Physics
from delaytools.simulation.schedule import Grid, Lookup

__all__ = [
    "Call",
    "Inputs",
    "Plan",
    "Stepper",
    "Walk",
    "cubic",
    "hermite",
    "join_state",
    "own_parts",
    "split_state",
    "state_size",
    "walk_spans",
    "weights",
]

Array = NDArray[np.float64]
ITERATIONS = 3
CAUGHT = 3.0  # times what is left of a span: a ramp at its start that goes beyond by this much ends within it
INSIDE = 1e-11  # s by which the ends of a span see the time inside it, so that a jump stays on its own side


@final
@dataclass(frozen=True)
class Inputs:
    """How the inputs of a call lie in one column: per span, external values, slopes and time where they are needed.

    per_span: numbers per span; extra: numbers per call after them.
    """

    model: Physics
    spans: int
    extra: int = 0

    @property
    def per_span(self) -> int:
        """Numbers per span: 3 values per external, 2 slopes where a delay reads one, the time where a formula does."""
        return self.points * len(self.model.layout.externals) + int(self.model.needs_time)

    @property
    def points(self) -> int:
        """Values per external and span."""
        return 5 if self.model.needs_slopes else 3

    @property
    def width(self) -> int:
        """Numbers per call."""
        return self.spans * self.per_span + self.extra

    def external(self, data: Any, i: int) -> list[Any]:
        """Externals at the start, middle and end of span i, and their scaled slopes at start and end."""
        count, at = len(self.model.layout.externals), i * self.per_span
        parts = [data[at + k * count : at + (k + 1) * count] for k in range(self.points)]
        return parts if self.points == 5 else [*parts, ca.SX.zeros(count, 1), ca.SX.zeros(count, 1)]

    def time(self, data: Any, i: int) -> Any:
        """The time at which span i begins."""
        return data[(i + 1) * self.per_span - 1] if self.model.needs_time else 0.0


@final
@dataclass(frozen=True)
class Call:
    """The unrolled function (state, data, p) -> (state, rows), and what its vectors mean.

    spans, rows: per call. depth: spans of history that the state holds. grid: the spans of one hyper-period, which
    the call holds `copies` times, or of the whole run where `copies` is 0. data: (calls, inputs.extra) numbers that
    each call takes beyond the externals. lookups: of one hyper-period. made: what was made of the function, kept for
    the next run.
    """

    function: ca.Function
    inputs: Inputs
    spans: int
    rows: int
    depth: int
    grid: Grid
    copies: int
    data: Array | None = None
    lookups: tuple[Lookup, ...] = ()
    made: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    def once(self, key: Any, make: Callable[[], Any]) -> Any:
        """What `make` gives, made at the first call with this key."""
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]


@final
@dataclass
class Walk:
    """What moves from span to span while a call is unrolled."""

    x: Any
    v: Any
    k: Any
    w: Any
    history: list[list[Any]]
    rows: list[Any]


def hermite(piece: Any, theta: Any) -> tuple[Any, Any]:
    """Value and θ-derivative of the cubic through (value, slope) at θ = 0 and θ = 1; piece: (4, 1)."""
    if isinstance(theta, float) and theta in (0.0, 1.0):
        first = 0 if theta == 0.0 else 2
        return piece[first], piece[first + 1]
    both = ca.mtimes(_weights(theta), piece)
    return both[0], both[1]


@cache
def weights() -> ca.Function:
    """θ -> (2, 4): what each number of a piece adds to value and θ-derivative there."""
    theta = ca.SX.sym("theta")
    return ca.Function("weights", [theta], [_weights(theta)])


def _weights(theta: Any) -> Any:
    value = [
        (1 + 2 * theta) * (1 - theta) ** 2,
        theta * (1 - theta) ** 2,
        theta**2 * (3 - 2 * theta),
        theta**2 * (theta - 1),
    ]
    slope = [
        6 * theta * (theta - 1),
        (1 - theta) * (1 - 3 * theta),
        6 * theta * (1 - theta),
        theta * (3 * theta - 2),
    ]
    if isinstance(theta, float):
        return ca.DM([value, slope])
    return ca.vertcat(ca.horzcat(*value), ca.horzcat(*slope))


def cubic() -> ca.Function:
    """`hermite` for a place that is a symbol: (piece, theta) -> (value, slope)."""
    piece, theta = ca.SX.sym("piece", 4), ca.SX.sym("theta")
    return ca.Function("cubic", [piece, theta], list(hermite(piece, theta)))


@final
class Stepper:
    """Advances a walk by one span, given how each delay looks back."""

    def __init__(self, physics: Physics, p: Any) -> None:
        self.physics, self.p = physics, p
        self._folded: dict[float, ca.DM] = {}

    def rates(self, x: Any, walk: Walk, d: Any, e: Any, clock: tuple[Any, Any]) -> Any:
        """x' at one stage."""
        return self.physics.rates(x, walk.v, d, walk.w, e, clock[0], clock[1], self.p)

    def advance(self, walk: Walk, d: Sequence[Any], e: Sequence[Any], t: Any, h: Any) -> Any:
        """x after the span: the classical Runge–Kutta step, as one matrix where everything is linear."""
        if self.physics.linear and isinstance(h, float):
            return self._matrix_step(walk, d, e, h)
        return self._step(walk.x, walk, d, e, (t, h))

    def _step(self, x: Any, walk: Walk, d: Sequence[Any], e: Sequence[Any], clock: tuple[Any, Any]) -> Any:
        t, h = clock
        k1 = self.rates(x, walk, d[0], e[0], (t + INSIDE, 0.0))
        k2 = self.rates(x + h / 2 * k1, walk, d[1], e[1], (t + h / 2, h / 2))
        k3 = self.rates(x + h / 2 * k2, walk, d[1], e[1], (t + h / 2, h / 2))
        k4 = self.rates(x + h * k3, walk, d[2], e[2], (t + h - INSIDE, h))
        return x + h / 6 * (k1 + 2 * (k2 + k3) + k4)

    def _matrix_step(self, walk: Walk, d: Sequence[Any], e: Sequence[Any], h: float) -> Any:
        key = round(h, 15)
        if key not in self._folded:
            parts = [walk.x, walk.v, *d, *e]
            symbols = [ca.SX.sym("s", ca.SX(part).shape[0]) for part in parts]
            nd, ne = len(d), len(e)
            imagined = Walk(symbols[0], symbols[1], None, ca.SX(0, 1), [], [])
            new = self._step(
                symbols[0], imagined, symbols[2 : 2 + nd], symbols[2 + nd : 2 + nd + ne], (0.0, h)
            )
            stacked = ca.vertcat(*symbols)
            self._folded[key] = ca.sparsify(ca.evalf(ca.jacobian(new, stacked)))
            self._folded[-key] = ca.evalf(ca.substitute(new, stacked, ca.DM.zeros(stacked.shape[0])))
        vector = ca.vertcat(*[ca.SX(part) for part in (walk.x, walk.v, *d, *e)])
        offset = self._folded[-key]
        moved = ca.mtimes(self._folded[key], vector)
        return moved + offset if np.any(np.array(offset)) else moved


@final
@dataclass(frozen=True)
class Plan:
    """How one call looks at its spans.

    length(i), ticking(i), look(i, delay, stage, walk) -> (value, slope): constants of a repeating grid, or symbols
    fed from data. looks_inside(i): whether a delay is shorter than the span.
    """

    length: Callable[[int], Any]
    ticking: Callable[[int], dict[str, Any]]
    look: Callable[[int, int, int, list[Any]], tuple[Any, Any]]
    looks_inside: Callable[[int], bool]
    row: Callable[[int], bool]
    time: Callable[[int], Any]


def walk_spans(
    stepper: Stepper, walk: Walk, plan: Plan, external: Callable[[int], list[Any]], spans: int
) -> None:
    """Unroll the spans one after the other."""
    physics = stepper.physics
    for i in range(spans):
        h, t, e = plan.length(i), plan.time(i), external(i)
        d0 = _delayed(plan, i, 0, walk)
        ticking = plan.ticking(i)
        if ticking:
            walk.v, walk.k = physics.tick(_point(walk, d0[0], e[0], t, 0.0, stepper.p), walk.k, ticking)
        if physics.layout.followers:
            walk.w = physics.follow(*_point(walk, d0[0], e[0], t, 0.0, stepper.p))
        if plan.row(i):
            walk.rows.append(physics.row(*_point(walk, d0[0], e[0], t, 0.0, stepper.p)))
        _one_span(stepper, walk, plan, i, (h, t, e, d0))


def _one_span(stepper: Stepper, walk: Walk, plan: Plan, i: int, now: tuple[Any, Any, list[Any], Any]) -> None:
    h, t, e, d0 = now
    count = len(stepper.physics.layout.transports)
    begin = _begin(stepper, walk, d0, (e[0], e[3]), (t, h)) if count else []
    guess = [ca.vertcat(a, da, a + da, da) for a, da in begin]
    rounds = ITERATIONS + 1 if plan.looks_inside(i) else 1
    for _ in range(rounds):
        for pieces, piece in zip(walk.history, guess, strict=True):
            pieces.append(piece)
        d1, d2 = _delayed(plan, i, 1, walk), _delayed(plan, i, 2, walk)
        for pieces in walk.history:
            pieces.pop()
        x = stepper.advance(walk, (d0[0], d1[0], d2[0]), e[:3], t, h)
        ended = Walk(x, walk.v, walk.k, walk.w, walk.history, walk.rows)
        if stepper.physics.layout.followers:
            ended.w = stepper.physics.follow(
                *_point(Walk(x, walk.v, None, walk.w, [], []), d2[0], e[2], t + h - INSIDE, h, stepper.p)
            )
        if count:
            after = Walk(x, walk.v, None, walk.w, [], [])
            end = _entry(stepper, after, d2, (e[2], e[4]), (t + h - INSIDE, h, h))
            follows = bool(stepper.physics.layout.followers)
            guess = [_piece(first, last, follows) for first, last in zip(begin, end, strict=True)]
    walk.x, walk.w = ended.x, ended.w
    for pieces, piece in zip(walk.history, guess, strict=True):
        pieces.append(piece)


def _point(walk: Walk, d: Any, e: Any, t: Any, elapsed: Any, p: Any) -> list[Any]:
    return [walk.x, walk.v, d, walk.w, e, t, elapsed, p]


def _delayed(plan: Plan, i: int, stage: int, walk: Walk) -> tuple[Any, Any]:
    if not walk.history:
        return ca.SX(0, 1), ca.SX(0, 1)
    looks = [plan.look(i, delay, stage, pieces) for delay, pieces in enumerate(walk.history)]
    return ca.vertcat(*[a for a, _ in looks]), ca.vertcat(*[b for _, b in looks])


def _piece(first: list[Any], last: list[Any], follows: bool) -> Any:
    """The cubic of a span from value and scaled derivative at its ends.

    Where a follower catches up with its input at the very beginning of the span, its fast ramp is no slope of the
    span: one is taken with which the cubic has the area of ramp and rest, since what reads a delay mostly adds it up.
    """
    (start, ramp), (end, rest) = first, last
    if not follows:
        return ca.vertcat(start, ramp, end, rest)
    rise = end - start
    caught = ca.fabs(ramp - rise) > CAUGHT * (ca.fabs(rise) + ca.fabs(rest))
    when = (rise - rest) / ca.if_else(caught, ramp - rest, 1.0)
    area = ramp * when**2 / 2 + rise * (1 - when) - rest * (1 - when) ** 2 / 2
    return ca.vertcat(start, ca.if_else(caught, 12 * (area - rise / 2) + rest, ramp), end, rest)


def _begin(
    stepper: Stepper, walk: Walk, d: tuple[Any, Any], e: tuple[Any, Any], span: tuple[Any, Any]
) -> list[list[Any]]:
    """What enters each delay where the span begins.

    A follower that is at its input, or on an end of its play, has two slopes there: that of a moment later counts.
    """
    t, h = span
    if not stepper.physics.layout.followers:
        return _entry(stepper, walk, d, e, (t, 0.0, h))
    rate = stepper.rates(walk.x, walk, d[0], e[0], (t + INSIDE, 0.0))
    after = Walk(walk.x + INSIDE * rate, walk.v, None, walk.w, [], [])
    late = INSIDE / h
    return _entry(stepper, after, (d[0] + late * d[1], d[1]), (e[0] + late * e[1], e[1]), (t + INSIDE, INSIDE, h))


def _entry(
    stepper: Stepper, walk: Walk, d: tuple[Any, Any], e: tuple[Any, Any], clock: Any
) -> list[list[Any]]:
    """What enters each delay at one end of the span: value and derivative times the span's length."""
    t, elapsed, h = clock
    point = _point(walk, d[0], e[0], t, elapsed, stepper.p)
    value, slope = stepper.physics.delayed(*point, e[1] / h, d[1] / h)
    return [[value[k], slope[k] * h] for k in range(len(stepper.physics.layout.transports))]


def own_parts(physics: Physics, state: Any) -> tuple[list[Any], int]:
    """x, v, k, w of a state vector, and where its history begins."""
    layout = physics.layout
    parts, at = [], 0
    for size in (len(layout.states), len(layout.held), len(layout.kept), len(layout.followers)):
        parts.append(state[at : at + size] if size else ca.SX(0, 1))
        at += size
    return parts, at


def split_state(physics: Physics, state: Any, depth: int) -> Walk:
    """The walk that a state vector holds."""
    layout = physics.layout
    parts, at = own_parts(physics, state)
    history: list[list[Any]] = []
    for _ in layout.transports:
        history.append(ca.vertsplit(state[at : at + 4 * depth], 4) if depth else [])
        at += 4 * depth
    return Walk(*parts, history, [])


def join_state(walk: Walk, depth: int) -> Any:
    """The state vector of a walk, with the last `depth` spans of history."""
    kept = [piece for pieces in walk.history for piece in pieces[len(pieces) - depth :]]
    return ca.vertcat(walk.x, walk.v, walk.k, walk.w, *kept)


def state_size(physics: Physics, depth: int) -> int:
    """Length of the state vector."""
    layout = physics.layout
    own = len(layout.states) + len(layout.held) + len(layout.kept) + len(layout.followers)
    return own + 4 * depth * len(layout.transports)
