"""Finite-amplitude profiles: what each candidate could take off the residual, other free values allowed for."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from delaytools.diagnosis.added import Added, path_of
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.pushes import forces_on
from delaytools.diagnosis.quantities import neutral_value
from delaytools.diagnosis.starts import GRID, LINEAR, SMALL, Candidate
from delaytools.diagnosis.views import View, case_view
from delaytools.diagnosis.wire_changes import change_at
from delaytools.diagnosis.wires import Way, own_way, way_of
from delaytools.loop.port import find_port
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["STRETCH", "Base", "Screened", "base_of", "response", "response_instead", "screened"]

Array = NDArray[np.float64]
STIFFEST = 10.0  # force over smoothing, in 1/row, beyond which friction is not resolved
SOFTLY = 3.0  # times the narrowest smoothing: where fits of friction begin
HELD = 0.7  # of its load: a friction that resists more hardly ever lets go, and no fit begins there
STEPWISE = ("period",)  # values that change nothing between rows
CLOSER, HALVINGS = 0.1, 3  # of the best worth that is looked at more closely, and how often
NEARBY = 0.01  # of a block's value: a step from which what is off by far less than a grid's is found along a line
TELLING, RIDGE = 1e-6, 1e-9  # of a stopped value's response that inner values leave, and of a Gram matrix of norm 1
STRETCH = (0.4, 2.5)  # by which a grid point's response may be scaled when its gain is judged


@final
@dataclass(frozen=True)
class Screened:
    """A candidate with its best start, and the χ² that it would take off."""

    added: Added
    gain: float


@final
@dataclass(frozen=True, eq=False)
class Base:
    """A fitted hypothesis as seen by candidates: its residual with all that its free values can do projected out.

    basis (rows, k), orthonormal, of the values inside their bounds. stopped (rows, m): how the exits move, by the rest
    of that, where a value that its bound stopped moves inside, each of norm 1. instead: of an effect that is known.
    """

    case: Case
    fitted: Fitted
    outputs: tuple[Array, ...]
    basis: Array
    residual: Array
    stopped: Array
    instead: bool = False
    _ways: dict[str, Way | None] = field(default_factory=dict, repr=False)

    @property
    def is_late(self) -> bool:
        """Whether time is up for a further effect: stiff frictions make a screening last as long as a search."""
        return self.case.is_late and (self.instead or bool(self.fitted.added))

    @cached_property
    def view(self) -> View:
        """The segment's signals under the hypothesis."""
        return case_view(self.case, self.fitted)

    def way(self, at: str) -> Way | None:
        """The way from a port to the exits, where an effect in a wire there need not be run in the loop itself."""
        if at not in self._ways:
            self._ways[at] = way_of(self.view, self.fitted, self.outputs, find_port(self.case.segment.loop, at))
        return self._ways[at]

    def moved_by(self, one: Added) -> tuple[Array, ...] | None:
        """Per log (n, exits): how the exits move by what the effect changes in its wire, or by its force along the
        measured motion; None where neither is known."""
        way, element = self.way(one.at), own_way(self.view, one)
        if way is None:
            return None
        if way.port.kind == "derivative":
            changes = forces_on(self.view, one)
        else:
            changes = None if element is None else change_at(self.view, way.port, element)
        return None if changes is None else way.moved(changes)

    def projected(self, rows: Array) -> Array:
        """What of whitened rows the free values cannot imitate."""
        return rows - self.basis @ (self.basis.T @ rows)

    def gain(self, change: Array, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
        """χ² that a whitened change of the outputs takes off at its best scale within [low, high], and that scale.

        Beside it a value that its bound stopped may move back inside, and no further out.
        """
        own = self.projected(change)
        power = float(own @ own)
        if not np.isfinite(power) or power <= 1e-12 * float(change @ change) or power <= 0:
            return 0.0, 0.0
        if self.stopped.shape[1]:
            size = np.sqrt(power)
            columns = np.concatenate([own[:, None] / size, self.stopped], axis=1)
            inward = self.stopped.shape[1]
            ends = (np.array([low * size, *[0.0] * inward]), np.array([high * size, *[np.inf] * inward]))
            square, along = columns.T @ columns, columns.T @ self.residual
            best = _within(square, along, *ends)
            return float(2 * best @ along - best @ square @ best), float(best[0] / size)
        scale = float(np.clip(float(own @ self.residual) / power, low, high))
        return 2 * scale * float(own @ self.residual) - scale**2 * power, scale


def _within(square: Array, along: Array, low: Array, high: Array) -> Array:
    """The least of x·square·x/2 - x·along with every x in [low, high], where these may be one."""
    best, free = low.copy(), low < high
    left = along[free] - square[np.ix_(free, ~free)] @ low[~free]
    root = np.linalg.cholesky(square[np.ix_(free, free)] + RIDGE * np.eye(int(free.sum())))
    best[free] = lsq_linear(root.T, np.linalg.solve(root, left), (low[free], high[free]), method="bvls").x
    return best


def base_of(case: Case, fitted: Fitted) -> Base:
    """The base of a fitted hypothesis; a value that its bound stops can imitate nothing further that way."""
    columns = fitted.jacobian[:, fitted.inside & (np.abs(fitted.jacobian).max(axis=0, initial=0.0) > 0)]
    scaled = columns / np.linalg.norm(columns, axis=0) if columns.size else columns
    basis, triangle = np.linalg.qr(scaled) if columns.size else (np.zeros((len(fitted.residual), 0)), scaled)
    if columns.size:
        basis = basis[:, np.abs(np.diag(triangle)) > 1e-7]
    residual = fitted.residual - basis @ (basis.T @ fitted.residual)
    outputs = case.outputs(fitted.added, fitted.values)
    return Base(case, fitted, outputs, basis, residual, _stopped(fitted, basis))


def _stopped(fitted: Fitted, basis: Array) -> Array:
    """(rows, m): how the exits move where each stopped value moves inside, less what inner values can do, of norm 1."""
    ends = [p for p, inside in zip(fitted.parameters, fitted.inside, strict=True) if not inside]
    inward = np.array([-1.0 if p.value - p.low < p.high - p.value else 1.0 for p in ends])
    moved = fitted.jacobian[:, ~fitted.inside] * inward if ends else np.zeros((len(fitted.residual), 0))
    own = moved - basis @ (basis.T @ moved)
    norms = np.linalg.norm(own, axis=0)
    useful = norms > TELLING * np.maximum(np.linalg.norm(moved, axis=0), 1e-300)
    return np.asarray(own[:, useful] / norms[useful])


def response(base: Base, one: Added) -> Array | None:
    """(rows,) whitened change of the exits when the effect is added at its values; None where the run fails."""
    change = base.moved_by(one)
    return _whitened(base, _simulated(base, (*base.fitted.added, one)) if change is None else change)


def _taken_off(base: Base, one: Added, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
    """χ² that the effect's response takes off at its best scale within [low, high], and that scale.

    Friction by the better one of two: along the measured motion it is the force that acted, however far the model is;
    along the model's own it holds a mass at rest, which a measured rate of nearly nothing cannot tell.
    """
    changes = [response(base, one)]
    if "smoothing" in one.values and base.way(one.at) is not None:
        changes.append(_whitened(base, _simulated(base, (*base.fitted.added, one))))
    return max((base.gain(change, low, high) for change in changes if change is not None), default=(0.0, 0.0))


def response_instead(base: Base, place: int, one: Added) -> Array | None:
    """(rows,) whitened change of the exits when the effect stands, at its values, instead of a fitted one."""
    added = base.fitted.added
    return _whitened(base, _simulated(base, (*added[:place], one, *added[place + 1 :]), place))


def _whitened(base: Base, change: tuple[Array, ...] | None) -> Array | None:
    if change is None or not all(np.isfinite(rows).all() and np.abs(rows).max(initial=0) < 1e100 for rows in change):
        return None
    return base.case.whitened(change)


def _simulated(base: Base, added: tuple[Added, ...], other: int | None = None) -> tuple[Array, ...] | None:
    """How the exits move with these effects, of which that at the place `other` is at its own values."""
    mine = f"{path_of(other)}." if other is not None else " "
    known = {p.path: p.value for p in base.fitted.parameters if not p.path.startswith(mine)}
    values = tuple(known.get(p.path, p.value) for p in base.case.parameters(added))
    try:
        outputs = base.case.outputs_nearly(added, values)
    except DelaytoolsError:
        return None
    return tuple(after - before for after, before in zip(outputs, base.outputs, strict=True))


def screened(base: Base, candidates: Iterable[Candidate]) -> list[Screened]:
    """Every candidate that takes something off, the most first."""
    found = [(one, best) for one in candidates if not base.is_late and (best := _best(base, one)) is not None]
    least = CLOSER * max((best.gain for _, best in found), default=0.0)
    nearer = (
        _between(base, one, best) if one.manner == GRID and best.gain > least and not base.is_late else best
        for one, best in found
    )
    return sorted(nearer, key=lambda s: -s.gain)


def _best(base: Base, candidate: Candidate) -> Screened | None:
    if candidate.manner == LINEAR:
        return _scaled(base, candidate.first, candidate.amplitude)
    found = [_best_of(base, candidate.tries)]
    (name, *others) = candidate.first.values
    if name == "half_width":  # far below the first of the grid what a band does grows as its width
        found.append(_scaled(base, candidate.first, name))
    if ":" in candidate.first.kind and name not in STEPWISE and not others:
        design = neutral_value(base.case.segment.loop, candidate.first, name)
        found.append(_scaled(base, candidate.first.moved({name: (1 + NEARBY) * design}), name))
    return max((one for one in found if one is not None), key=lambda one: one.gain, default=None)


def _best_of(base: Base, tries: Sequence[Added]) -> Screened | None:
    """The best of a grid: every point where a response costs little, else every second one and the best one's sides."""
    way = base.way(tries[0].at)
    gains: dict[int, float] = {}

    def look(places: Iterable[int]) -> None:
        for place in places:
            if 0 <= place < len(tries) and place not in gains:
                gains[place] = _taken_off(base, tries[place], *STRETCH)[0]

    look(range(0, len(tries), 1 if way is not None and way.is_quick else 2))
    top = max(gains, key=gains.__getitem__)
    look((top - 1, top + 1))
    top = max(gains, key=gains.__getitem__)
    return Screened(tries[top], gains[top]) if gains[top] > 0 else None


def _between(base: Base, candidate: Candidate, best: Screened) -> Screened:
    """The best of a grid moved to where most is taken off between its neighbours, by halving the ratios in turn.

    What acts in a few rows only, as a limit does, is worth much in a range far narrower than any grid.
    """
    (name,) = best.added.values
    grid = sorted(one.values[name] for one in candidate.tries)
    if name in STEPWISE or best.added.values[name] not in grid:
        return best
    place = grid.index(best.added.values[name])
    ratio = max((b / a for a, b in pairwise(grid[max(place - 1, 0) : place + 2])), default=1.0)
    for _ in range(HALVINGS):
        ratio, middle = math.sqrt(ratio), best.added.values[name]
        for value in (middle / ratio, middle * ratio):
            moved = best.added.moved({name: value})
            best = max(best, Screened(moved, _taken_off(base, moved, *STRETCH)[0]), key=lambda one: one.gain)
    return best


def _not_too_stiff(one: Added, narrowest: float) -> Added:
    """Friction whose smoothing stays wide enough for a few steps per row, and begins wider: far from the truth a stiff
    one, above all with stiction, makes χ² jump from value to value."""
    low, high = one.limits.get("smoothing", (0.0, np.inf))
    low = max(low, narrowest)
    limits = {**one.limits, "smoothing": (low, max(high, 2 * SOFTLY * low))}
    return replace(one.moved({"smoothing": max(one.values["smoothing"], SOFTLY * narrowest)}), limits=limits)


def _scaled(base: Base, one: Added, amplitude: str) -> Screened | None:
    gain, scale = _taken_off(base, one)
    spec = one.specification(base.case.segment.loop, amplitude)
    neutral = neutral_value(base.case.segment.loop, one, amplitude)
    start = one.values[amplitude]
    best = neutral + scale * (start - neutral)
    if gain <= 0 or not spec.allows(best):
        return None
    if one.kind == "load_dependent_friction" and "load" not in one.fixed:
        best = min(best, HELD)
    factor = {amplitude: best, **{n: v * scale for n, v in one.values.items() if n in ("stiction",)}}
    moved = one.moved(factor)
    if "smoothing" not in one.values:
        return Screened(moved, gain)
    force = SMALL * base.view.derivative(find_port(base.case.segment.loop, one.at)) * best / start  # it began at SMALL
    moved = _not_too_stiff(moved, force * base.case.step / STIFFEST)
    return Screened(moved, max(_taken_off(base, moved, *STRETCH)[0], 0.5 * gain))
