"""Quantisers: their cost is no smooth function of the step, so that steps are tried, from coarse to exact."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.lattices import on_lattice
from delaytools.diagnosis.places import Spot
from delaytools.diagnosis.screen import Base, Screened, response
from delaytools.diagnosis.views import View
from delaytools.diagnosis.wires import Way
from delaytools.estimation.noise_level import difference_noise
from delaytools.loop.port import find_port

__all__ = ["quantisations", "with_step_fitted"]

Array = NDArray[np.float64]
KIND = "quantization"
EXCESS = 1.05  # of the noise: a residual below it is not worth a search for quantisation further upstream
FINEST = 1e-7  # of a step: how well it is to be known
AROUND = 0.03  # of the best step: where a better one may lie
TRIED, TRIED_SLOWLY = 12, 4  # steps whose change is sent through the segment, by convolution and by runs
COARSE, SIZES = (0.05, 2.0), 25  # of the signal's spread: steps so large that their pattern needs no fine grid
NEAREST_STEPS, NEAREST_SHOWN = 0.003, 0.0004  # relative, between steps at a port inside, and at an exit itself
FINE = 0.1  # of a signal's spread: the rounding of a finer step is white
AS_GOOD, HALVED = 4.0, 6  # χ² by which a step may be worse, and how often its edge is halved
MOST_SHOWN = 6000
MOST_STEPS = 900  # of a quantiser that are tried at a port


def quantisations(base: Base, view: View, spots: Sequence[Spot]) -> list[Screened]:
    """The best step of a quantiser at every port: the lattice of the log where there is one, else a fine grid.

    In real runs the lattice alone: errors of the model hide the pattern by which a step further upstream shows.
    """
    found = []
    for spot in (s for s in spots if s.kind == KIND):
        signals = view.at(spot.port)
        if (one := on_lattice(base.case, spot.port)) is not None:
            change = response(base, one)
            found.extend([Screened(one, base.gain(change, 0.9, 1.1)[0])] if change is not None else [])
        elif not base.case.pieces and (best := _best_step(base, spot, signals)) is not None:
            found.append(best)
    return found


def _best_step(base: Base, spot: Spot, signals: tuple[Array, ...]) -> Screened | None:
    spread = float(np.std(np.concatenate(signals)))
    shown = base.case.exit_at(str(spot.port))
    left = base.case.measured[0] - base.outputs[0]
    if spread <= 0 or (shown is None and not _above_noise(base.case, left)):
        return None
    way, at = base.way(str(spot.port)), str(spot.port)
    if way is None or way.every == 0:  # no pulse speaks for all times: nothing to choose steps by
        return None
    size = _size_by_power(base, way) if shown is None else float(np.sqrt(12) * left[:, shown].std())
    if not 0 < size < np.inf:
        return None
    weights = way.weights(base.residual)
    nearest = NEAREST_STEPS if shown is None else NEAREST_SHOWN
    high = max((3.0 if shown is None else 1.3) * size, COARSE[1] * spread)
    steps = _steps((spread, nearest), 0.25 * size, high, MOST_STEPS if shown is None else MOST_SHOWN)
    promised = np.array([_worth(base, way, (signals, weights), step, shown is not None) for step in steps])
    first = np.argsort(promised)[::-1][: TRIED if way.is_quick else TRIED_SLOWLY]
    tried = {float(steps[k]) for k in first if promised[k] > 0}
    if way.is_quick and shown is None:
        tried |= {float(step) for step in np.geomspace(*COARSE, SIZES) * spread}
    scores = {step: _score(base, at, step) for step in tried}
    top = max(scores, key=scores.__getitem__, default=0.0)
    if scores.get(top, 0.0) <= 0:
        return None
    return _finer(base, at, (top, AROUND * top), slowly=not way.is_quick)


def _worth(
    base: Base, way: Way, rows: tuple[tuple[Array, ...], tuple[Array, ...]], step: float, shown: bool
) -> float:
    """χ² that a step is worth, to choose steps by; rows: signals and weights at the port, shown: it is an exit."""
    if shown and step <= FINE * float(np.std(np.concatenate(rows[0]))):
        return 2 * _along(step, way, *rows) - step**2 / 12 * way.white_power
    if shown or not way.is_quick:
        return _promised(step, way, *rows)
    return _score(base, str(way.port), step)


def _finer(base: Base, at: str, range_of: tuple[float, float], *, slowly: bool = False) -> Screened:
    """The best step within middle ± width, as good as a grid shows."""
    middle, width = range_of
    tried = middle + width * np.linspace(-1, 1, 13 if slowly else 61)
    scores = np.array([_score(base, at, step) for step in tried])
    best = int(np.argmax(scores))
    sure = tried[scores >= scores[best] - 4.0]
    error = max((sure[-1] - sure[0]) / 4, (tried[1] - tried[0]) / 2)
    one = Added(KIND, at, {"step": float(tried[best])}, {}, frozenset({"step"}), {}, {"step": float(error)})
    return Screened(one, _gain(base, at, float(tried[best])))


def with_step_fitted(base: Base, one: Added) -> Screened:
    """The quantiser with its step in the middle of where no row would be rounded otherwise."""
    found = Screened(one, _gain(base, one.at, one.values["step"]))
    if on_lattice(base.case, find_port(base.case.segment.loop, one.at)) is not None:
        return found
    way = base.way(one.at)
    while way is not None and way.is_quick and found.added.errors["step"] > FINEST * found.added.values["step"]:
        middle, width = found.added.values["step"], 2 * found.added.errors["step"]
        finer = _finer(base, one.at, (middle, width))
        if finer.added.errors["step"] > 0.5 * found.added.errors["step"]:
            return _centred(base, max(found, finer, key=lambda screened: screened.gain))
        found = finer
    return _centred(base, found) if way is not None and way.is_quick else found


def _centred(base: Base, found: Screened) -> Screened:
    """The step in the middle of those that are as good as it without a worse one between them, and their spread."""
    at, step = found.added.at, found.added.values["step"]
    least, edges = _score(base, at, step) - AS_GOOD, []
    for way in (-1.0, 1.0):
        inside, outside = 0.0, FINEST * step
        while outside < AROUND * step and _score(base, at, step + way * outside) >= least:
            inside, outside = outside, 2 * outside
        for _ in range(HALVED):
            middle = 0.5 * (inside + outside)
            good = _score(base, at, step + way * middle) >= least
            inside, outside = (middle, outside) if good else (inside, middle)
        edges.append(step + way * inside)
    spread = float((edges[1] - edges[0]) / np.sqrt(12))
    centred = found.added.moved({"step": float(np.mean(edges))})
    errors = {"step": max(spread, FINEST * step)}
    return Screened(replace(centred, errors=errors), _gain(base, at, centred.values["step"]))


def _size_by_power(base: Base, way: Way) -> float:
    """The step whose rounding, white and of variance step²/12, would bring the power of the residual to the exits."""
    power = float(base.residual @ base.residual)
    return float(np.sqrt(12 * power / way.white_power)) if way.white_power > 0 else 0.0


def _above_noise(case: Case, left: Array) -> bool:
    """Whether the residual of an exit is more than the noise that its fourth differences show."""
    noises = [difference_noise(column) for column in case.measured[0].T]
    held = [exit in case.records[0].held for exit in case.exits]
    return any(
        h or rms > EXCESS * noise for h, rms, noise in zip(held, left.std(axis=0), noises, strict=True)
    )


def _promised(step: float, way: Way, signals: tuple[Array, ...], weights: tuple[Array, ...]) -> float:
    """χ² that a quantiser of this step would take off, as if the log were one period and nothing else were free.

    What its change sends to the exits counts both ways: a wrong step may go with a slow residual by chance, and then
    brings more power than it takes off.
    """
    found = 2 * _along(step, way, signals, weights)
    for u, gain in zip(signals, way.gains, strict=True):
        power = np.abs(np.fft.rfft(way.read(_rounding(u, step)))) ** 2 * gain
        found -= float(2 * power.sum() - power[0]) / len(u)
    return found


def _along(step: float, way: Way, signals: tuple[Array, ...], weights: tuple[Array, ...]) -> float:
    """How far a quantiser's change moves the exits along the residual."""
    return sum(
        float(way.read(_rounding(u, step)) @ w) for u, w in zip(signals, weights, strict=True)
    )


def _steps(signal: tuple[float, float], low: float, high: float, most: int) -> Array:
    """Steps as far apart as the rounding of a signal keeps its pattern; signal: its spread, and the nearest ratio."""
    (spread, nearest), found = signal, [low]
    while found[-1] < high and len(found) < most:
        found.append(found[-1] * (1 + np.clip(0.08 * found[-1] / spread, nearest, 0.03)))
    return np.array(found)


def _left(base: Base, at: str, step: float) -> Array | None:
    """(rows,): what a quantiser of this step leaves, other free values moved; None where the run fails."""
    way = base.way(at)
    if way is not None and way.is_quick:
        moved = way.convolved(tuple(_rounding(u, step) for u in base.view.at(way.port)))
        change = None if moved is None else base.case.whitened(moved)
    else:
        change = response(base, Added(KIND, at, {"step": float(step)}))
    return None if change is None else base.residual - base.projected(change)


def _score(base: Base, at: str, step: float) -> float:
    """By how much a step leaves less, no row counted for more than noise may be.

    One row rounded the other way would decide between steps by itself.
    """
    left = _left(base, at, step)
    if left is None:
        return -np.inf
    levels = base.case.cut_levels
    return float(np.sum(np.minimum(np.abs(base.residual), levels) ** 2 - np.minimum(np.abs(left), levels) ** 2))


def _gain(base: Base, at: str, step: float) -> float:
    """χ² that a quantiser of this step takes off; few odd rows count for nothing."""
    left = _left(base, at, step)
    if left is None:
        return 0.0
    before, after = (base.case.without_odd_rows(rows) for rows in (base.residual, left))
    return float(before @ before - after @ after)


def _rounding(u: Array, step: float) -> Array:
    """What a quantiser adds to a signal."""
    return step * np.floor(u / step + 0.5) - u
