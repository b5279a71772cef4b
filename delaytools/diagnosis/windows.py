"""Candidates that act in one stretch of time: transient gains."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from delaytools.blocks.block import Sampled
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.edges import EDGES, changed_at_port, edge_beside, edge_near
from delaytools.diagnosis.places import Spot
from delaytools.diagnosis.screen import Base, Screened, response, response_instead
from delaytools.diagnosis.wires import Way
from delaytools.loop.port import find_port
from delaytools.loop.values import resolve

__all__ = ["edges_beside", "transients", "with_edges_fitted"]

Array = NDArray[np.float64]
SMALL = 0.02
FIRST_MOVE, LAST_MOVE = 4.0, 0.02  # cells
MOVES = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1))
PROBED, LOCAL = 4, 10  # rows by which an edge is moved to see what it does, and up to which that tells its error
ROWS_APART, RUNS = 10.0, 80  # of the corners of a first simplex of edges, and how many of its places are tried
SPIKES = 7
TURNS = 5  # in which start and end are sought by rows
SURELY = 12.0  # χ² by which a place of an edge is worse than the best: surely not there
FARTHEST, PLACES = 1.0, 25  # s from the best place, and places between there and here that are looked at
TRIED = ((1 / 3, 1 / 3), (0.18, 0.09), (0.46, 0.13), (0.71, 0.11), (0.87, 0.05))  # start and length, of the log
FORGOTTEN = 0.5  # of the power of a window's answer: so much outside the window and otherwise inside is too much
BEGINNINGS = 80  # times between which windows of gain are sought exactly
TRUE = 0.1  # of the χ² that a place of an edge is said to take off: by how much a run may differ
SHOWN = 4.0  # χ² that half a row must take off: less is chance, and where nothing is held rows show no more
EVEN = 1e-6
CELLS = 400  # stretches of time between which the edges of a transient are sought
SHORTEST, LONGEST = 4, 320  # cells: shorter ones are single rows gone wrong, longer ones the gain itself


def transients(base: Base, spots: Sequence[Spot]) -> list[Screened]:
    """The stretch of time in which another gain takes most off the residual, at every port for gains.

    Not in several real runs: what happens at one time since the start of each is no event of the bench.
    """
    if base.case.pieces and len(base.case.records) > 1:
        return []
    found = []
    for spot in (s for s in spots if s.kind == "transient_gain"):
        whole = Added("scale_factor", str(spot.port), {"factor": 1 + SMALL})
        change = response(base, whole)
        if change is None:
            continue
        way = base.way(str(spot.port))
        if way is not None and way.is_quick and not _forgets(base, whole, change):
            start, end, scale, gain = _best_window(base, way)
        else:
            start, end, scale, gain = _best_stretch(base, base.projected(change))
        values = {"factor": 1 + SMALL * scale, "start": start, "end": end}
        one = Added(spot.kind, str(spot.port), values, {}, frozenset({"start", "end"}))
        found.append(Screened(one, gain))
    return found


def _best_stretch(base: Base, change: Array) -> tuple[float, float, float, float]:
    """start, end (s), scale and χ² gain of the best run of cells."""
    rows = base.case.rows
    cell = np.minimum((rows.time / base.case.duration * CELLS).astype(int), CELLS - 1)
    up = np.concatenate([[0.0], np.cumsum(np.bincount(cell, change * base.residual, CELLS))])
    down = np.concatenate([[0.0], np.cumsum(np.bincount(cell, change * change, CELLS))])
    rise, power = up[None, :] - up[:, None], down[None, :] - down[:, None]
    long = np.arange(CELLS + 1)[None, :] - np.arange(CELLS + 1)[:, None]
    allowed = (long >= SHORTEST) & (long <= LONGEST) & (power > 1e-9 * max(down[-1], 1e-300))
    gain = np.where(allowed, rise**2 / np.where(allowed, power, 1.0), 0.0)
    first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
    width = base.case.duration / CELLS
    scale = rise[first, last] / max(power[first, last], 1e-300)
    return float(first * width), float(last * width), float(scale), float(gain[first, last])


def _forgets(base: Base, whole: Added, change: Array) -> bool:
    """Whether windows of gain change little outside their own stretch: not where the segment integrates.

    Several windows, since what leaves one may happen to come to nothing: a push forth and back.
    """
    time, duration = base.case.rows.time, base.case.duration
    for start, length in TRIED:
        begin, end = start * duration, (start + length) * duration
        window = Added("transient_gain", whole.at, {**whole.values, "start": begin, "end": end})
        answer = response(base, window)
        if answer is None:
            continue
        inside = np.where((time >= begin) & (time < end), change, 0.0)
        if np.sum((answer - inside) ** 2) > FORGOTTEN * np.sum(answer**2):
            return False
    return True


def _best_window(base: Base, way: Way) -> tuple[float, float, float, float]:
    """start, end (s), scale and χ² gain of the best window, by the answers to gains that begin at each of many times.

    A window is the difference of two of these; with S their projected answers, its χ² is (rᵀ(S_a - S_b))²/|S_a - S_b|².
    """
    changes = changed_at_port(base, way)
    times = base.case.duration * np.arange(BEGINNINGS + 1) / BEGINNINGS
    answers: list[list[Array]] = [[] for _ in changes]
    for begin in times:
        pairs = zip(base.case.records, changes, strict=True)
        sent = way.convolved(tuple(np.where(r.time - r.time[0] >= begin - 1e-9, u, 0.0) for r, u in pairs))
        assert sent is not None
        for own, rows in zip(answers, sent, strict=True):
            own.append(rows)
    S = base.projected(base.case.whitened(tuple(np.stack(own, axis=2) for own in answers)))
    along, square = S.T @ base.residual, S.T @ S
    rise = along[:, None] - along[None, :]
    power = np.diag(square)[:, None] + np.diag(square)[None, :] - 2 * square
    long = np.arange(len(times))[None, :] - np.arange(len(times))[:, None]
    allowed = (long > 0) & (long <= LONGEST * BEGINNINGS / CELLS) & (power > 1e-9 * max(power.max(), 1e-300))
    gain = np.where(allowed, rise**2 / np.where(allowed, power, 1.0), 0.0)
    first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
    scale = rise[first, last] / max(power[first, last], 1e-300)
    return float(times[first]), float(times[last]), float(scale), float(gain[first, last])


def with_edges_fitted(base: Base, one: Added) -> Screened:
    """The transient with start and end moved to where most is taken off; its factor scaled to fit."""
    edges = np.array([one.values["start"], one.values["end"]])
    starts = [edges, *_between_spikes(base)]
    gains = [_taken_off(base, one, place) for place in starts]
    best, edges = max(gains), starts[int(np.argmax(gains))]
    way, by_rows = base.way(one.at), None
    if way is not None and way.is_quick:
        by_rows = _by_rows(base, way, one, edges)
        if _taken_off(base, one, np.array([place for place, _ in by_rows])) < best:
            by_rows = None  # what integrates answers an early pulse with more than a late one: far away that counts
    if by_rows is None:
        edges = _pattern_search(base, one, (best, edges))
        by_rows = [_centred(base, one, edges, side) for side in (0, 1)]
    start, end = by_rows
    moved = one.moved({"start": max(start[0], 0.0), "end": end[0]})
    change = response(base, moved)
    gain, scale = (0.0, 1.0) if change is None else base.gain(change)
    found = moved.moved({"factor": 1 + scale * (one.values["factor"] - 1)})
    errors = {name: _at_ticks(base, one.at, edge) for name, edge in zip(EDGES, (start, end), strict=True)}
    return Screened(replace(found, errors=errors), gain)


def edges_beside(base: Base) -> Added | None:
    """The last effect of the base's hypothesis, a window of gain, with the edge that takes more off where it is best
    beside what was fitted with it; None where the way to the exits is not quick."""
    one = base.fitted.added[-1]
    way = base.way(one.at)
    if way is None or not way.is_quick:
        return None
    found = {name: edge_beside(base, way, one, side) for side, name in enumerate(EDGES)}
    moves = []
    for name, (place, _, said) in found.items():
        moved = one.moved({name: place})
        gain = _instead(base, moved)
        moves.append((said if abs(gain - said) < max(SHOWN, TRUE * abs(said)) else gain, moved))
    for name in found:  # a held signal shows where in a row its gain changes
        for half in (-0.5, 0.5):
            moved = one.moved({name: max(one.values[name] + half * base.case.step, 0.0)})
            gain = _instead(base, moved)
            moves.append((gain if gain > SHOWN else 0.0, moved))
    if max(gain for gain, _ in moves) < SHOWN:  # both edges may have to move at once
        moves.append(_both_moved(base, one))
    best = max(moves, key=lambda move: move[0])[1]
    spreads = {name: error for name, (_, error, _) in found.items()}
    if any(_is_worse(base, best, name, error) for name, error in spreads.items()):
        spreads = _local_errors(base, one) or spreads
    return replace(best, errors={name: _at_ticks(base, one.at, (best.values[name], e)) for name, e in spreads.items()})


def _instead(base: Base, moved: Added) -> float:
    """χ² that the window of the base's hypothesis takes off in another place, all that was fitted with it free."""
    change = response_instead(base, len(base.fitted.added) - 1, moved)
    return 0.0 if change is None else base.gain(change, 1.0, 1.0)[0]


def _is_worse(base: Base, best: Added, name: str, error: float) -> bool:
    """Whether an edge that is said to lie within an error is surely not as far away, by runs."""
    if error < LOCAL * base.case.step:
        return False
    places = (best.values[name] - error, best.values[name] + error)
    gains = [_instead(base, best.moved({name: max(place, 0.0)})) for place in places]
    return max(gains) < _instead(base, best) - SURELY


def _local_errors(base: Base, one: Added) -> dict[str, float] | None:
    """Standard errors of both edges from what a few rows of each do, all else free; None where a window is so weak that
    its edges may lie farther away than that holds."""
    step, place = base.case.step, len(base.fitted.added) - 1
    changes = [response_instead(base, place, one.moved({name: one.values[name] + PROBED * step})) for name in EDGES]
    if any(change is None for change in changes):
        return None
    columns = base.projected(np.stack([change for change in changes if change is not None], axis=1)) / (PROBED * step)
    _, sizes, sides = np.linalg.svd(columns, full_matrices=False)
    errors = np.sqrt(np.sum((sides.T / np.maximum(sizes, 1e-300)) ** 2, axis=1))
    if errors.max() > LOCAL * step:
        return None
    return {name: float(np.hypot(error, step / np.sqrt(12))) for name, error in zip(EDGES, errors, strict=True)}


def _both_moved(base: Base, one: Added) -> tuple[float, Added]:
    """The window with both edges where most is taken off, by the simplex method from rows beside its own (Nelder 1965).

    Behind an integrator only the whole push and its middle show well: along the rest, edges and factor move together.
    """
    step, edges = base.case.step, np.array([one.values[name] for name in EDGES])

    def placed(shift: Array) -> Added:
        return one.moved(dict(zip(EDGES, map(float, edges + shift * step), strict=True)))

    def left(shift: Array) -> float:
        start, end = edges + shift * step
        return -_instead(base, placed(shift)) if 0 <= start < end - step else np.inf

    corners = np.array([[0.0, 0.0], [ROWS_APART, 0.0], [0.0, -ROWS_APART]])
    options = {"initial_simplex": corners, "xatol": 0.1, "fatol": 1.0, "maxfev": RUNS}
    found = minimize(left, np.zeros(2), method="Nelder-Mead", options=options)
    return float(-found.fun), placed(found.x)


def _at_ticks(base: Base, at: str, edge: tuple[float, float]) -> float:
    """The standard error of an edge (place, own error), with where it may lie between two ticks.

    Of what reads the signal behind it; and where a sampled block writes the signal and the edge is at one of its ticks,
    of that block: its input may have changed at any time since the tick before.
    """
    (place, error), way, loop = edge, base.way(at), base.case.segment.loop
    rows, port = way.every if way is not None and way.every > 1 else 0, find_port(loop, at)
    block = resolve(loop)[port.element].block
    if port.kind == "output" and isinstance(block, Sampled):
        period, off = float(block.period), base.case.step * (1 + EVEN)
        rows = max(rows, round(period / base.case.step)) if abs(math.remainder(place, period)) <= off else rows
    return math.hypot(error, rows * base.case.step / math.sqrt(3))


def _by_rows(base: Base, way: Way, one: Added, edges: Array) -> list[tuple[float, float]]:
    """Start and end, each with its standard error: in turn by every row near it, until neither moves."""
    names, found = ("start", "end"), [(float(edge), 0.0) for edge in edges]
    for _ in range(TURNS):
        before = [place for place, _ in found]
        for side in (0, 1):
            here = one.moved(dict(zip(names, (place for place, _ in found), strict=True)))
            found[side] = edge_near(base, way, here, side) or found[side]
        if max(abs(place - old) for (place, _), old in zip(found, before, strict=True)) < 0.5 * base.case.step:
            break
    return found


def _pattern_search(base: Base, one: Added, begin: tuple[float, Array]) -> Array:
    """The best edges from four cells down to a fiftieth of one: the cost has kinks where an edge crosses a row."""
    (best, edges), step = begin, FIRST_MOVE * base.case.duration / CELLS
    while step > LAST_MOVE * base.case.duration / CELLS and not base.case.is_late:
        moves = [edges + step * np.array(move) for move in MOVES]
        tried = [(_taken_off(base, one, place), place) for place in moves]
        top, place = max(tried, key=lambda pair: pair[0])
        if top > best:
            best, edges = top, place
        else:
            step /= 2
    return edges


def _centred(base: Base, one: Added, edges: Array, side: int) -> tuple[float, float]:
    """An edge in the middle of where it may lie, and its standard error: mean and spread under exp(χ²/2).

    Where the signal rests, every place of an edge explains the log as well.
    """
    best, step = _taken_off(base, one, edges), base.case.step
    if base.case.is_late:
        return float(edges[side]), step

    def at(shift: float) -> float:
        moved = edges.copy()
        moved[side] += shift
        return _taken_off(base, one, moved)

    reach = []
    for way in (-1.0, 1.0):
        far = step
        while far < FARTHEST and at(way * far) > best - SURELY:
            far *= 2
        reach.append(way * far)
    shifts = np.linspace(*reach, PLACES)
    gains = np.array([at(shift) for shift in shifts])
    weights = np.exp(0.5 * (gains - gains.max()))
    weights /= weights.sum()
    mean = float(weights @ shifts)
    spread = np.sqrt(float(weights @ (shifts - mean) ** 2) + (step**2 + (shifts[1] - shifts[0]) ** 2) / 12)
    return float(edges[side]) + mean, float(spread)


def _between_spikes(base: Base) -> list[Array]:
    """Edges at the sharpest rows of the residual of the first log: a gain that jumps at an exit shows there."""
    rows = base.case.rows
    first = (rows.log == 0) & (rows.exit == 0)
    size, time = np.abs(base.residual[first]), rows.time[first]
    found: list[float] = []
    for row in np.argsort(size)[::-1][: 20 * SPIKES]:
        if len(found) < SPIKES and all(abs(time[row] - t) > 5 * base.case.step for t in found):
            found.append(float(time[row]))
    found.sort()
    return [np.array([a, b]) for k, a in enumerate(found) for b in found[k + 1 :]]


def _taken_off(base: Base, one: Added, edges: Array) -> float:
    width = base.case.duration / CELLS
    if not 0.6 * SHORTEST * width < edges[1] - edges[0] < 1.05 * LONGEST * width or edges[0] < -width:
        return 0.0
    change = response(base, one.moved({"start": float(max(edges[0], 0.0)), "end": float(edges[1])}))
    return 0.0 if change is None else base.gain(change)[0]
