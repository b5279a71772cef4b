"""Quantisers: their cost is no smooth function of the step, so that steps are tried, from coarse to exact."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.signal import find_peaks

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.lattices import on_lattice, step_through_noise
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
LEAST = 0.05  # of the step whose white rounding would leave the residual, of which noise may be the most
TRIED, TRIED_SLOWLY, SURER = 80, 2, 100.0  # steps sent through the segment by convolution and by runs; times the noise
FINE, COARSEST = 0.05, 2.0  # of a signal's spread: the rounding of a finer step is white; of its peak: none is coarser
NEAREST, FARTHEST = 0.08, 0.03  # between coarse steps, relative: of the step over the spread, and at most
HARMONICS, CELLS = 3, 8  # of a rounding's pattern over its signal, and cells for a period of the last
MOSTLY, NEARLY = 0.8, 0.35  # of the residual that a step takes off, and of that what a step by chance takes off at most
MUCH = 1.5  # times the noise: a residual that is still far from explained
FINER, MOST_CELLS = 16, 2**18  # frequencies for one period in the signal's range, and cells at most
AS_GOOD, HALVED = 4.0, 6  # χ² by which a step may be worse, and how often its edge is halved


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
    if not 0 < spread < np.inf or (shown is None and not _above_noise(base.case, left)):
        return None
    way, at = base.way(str(spot.port)), str(spot.port)
    if way is None or way.every == 0:  # no pulse speaks for all times: nothing to choose steps by
        return None
    size = _size_by_power(base, way) if shown is None else float(np.sqrt(12) * left[:, shown].std())
    if not 0 < size < np.inf:
        return None
    rows, count = (signals, way.weights(base.residual)), TRIED if way.is_quick else TRIED_SLOWLY
    changes = (rows[1], _estimated(way, rows[1], size))
    tried = [s for one in changes for s in _fine_steps((signals, one), (LEAST * size, FINE * spread), count)]
    exactly = way.is_quick and shown is None
    coarse = _coarse_steps(spread, max(float(np.abs(u).max()) for u in signals))
    promised = np.array([_score(base, at, s) if exactly else _promised(s, way, *rows) for s in coarse])
    tried += [float(coarse[k]) for k in np.argsort(promised)[::-1][:count] if promised[k] > 0]
    scores = {step: _score(base, at, step) for step in tried}
    top = max(scores, key=scores.__getitem__, default=0.0)
    if scores.get(top, 0.0) <= 0:
        return None
    found = _finer(base, at, (top, AROUND * top), slowly=not way.is_quick)
    return None if shown is None and _is_chance(base, found, scores) else found


def _is_chance(base: Base, found: Screened, scores: Mapping[float, float]) -> bool:
    """Whether another step, far from this one, takes nearly as much off where either leaves much.

    What an integrating segment makes of rounding wanders, and among so many steps one wanders as any slow residual
    does: a true step stands out. Multiples share its pattern.
    """
    step = found.added.values["step"]
    power, rows = float(base.residual @ base.residual), len(base.residual)
    if power - found.gain < max(MUCH * rows, (1 - MOSTLY) * power):
        return False
    ratios = {other: max(other / step, step / other) for other in scores}
    others = [one for one, ratio in ratios.items() if abs(ratio / np.round(ratio) - 1) > AROUND and scores[one] > 0]
    if not others:
        return False
    rival = max(others, key=scores.__getitem__)
    way = base.way(found.added.at)
    slowly = way is None or not way.is_quick
    return _finer(base, found.added.at, (rival, AROUND * rival), slowly=slowly).gain > NEARLY * found.gain


def _estimated(way: Way, weights: tuple[Array, ...], size: float) -> tuple[Array, ...]:
    """Per log (n,): the change at the port, white and of a step of this size, that the residual shows (Wiener 1949).

    Weighted as the exits answer, what a segment integrates would go with its slowest part alone, as any step's does.
    """
    power = SURER * 12 / size**2
    pairs = zip(weights, way.gains, strict=True)
    return tuple(way.read(np.fft.irfft(np.fft.rfft(w) / (gain + power), len(w))) for w, gain in pairs)


def _fine_steps(
    rows: tuple[tuple[Array, ...], tuple[Array, ...]], within: tuple[float, float], count: int
) -> list[float]:
    """Steps within these limits whose rounding goes best with a change at the port, in all and for its size; rows:
    signals there, and that change.

    What rounding adds to u is step Σ (-1)^k sin(2πk u/step)/(πk), so that its sum with the weights follows for all
    steps at once from the Fourier transform of the weights over the values of u. By chance it grows as the step.
    """
    low, high = within
    u, weights = (np.concatenate(part) for part in rows)
    width = max(low / (HARMONICS * CELLS), float(np.ptp(u)) / MOST_CELLS)
    cells = (u - u.min()) / width
    first = cells.astype(np.int64)
    part = cells - first
    line = np.bincount(first, weights * (1 - part), first.max() + 2) + np.bincount(first + 1, weights * part)
    size = next_fast_len(FINER * len(line), real=True)
    per_unit = np.fft.rfftfreq(size, width)
    sums = (np.fft.rfft(line, size).conj() * np.exp(2j * np.pi * per_unit * u.min())).imag
    first_and_last = np.searchsorted(per_unit, [1 / high, 1 / low])
    chosen = np.arange(max(1, first_and_last[0]), min(first_and_last[1], len(sums) // HARMONICS))
    steps = 1 / per_unit[chosen]
    along = sum((-1) ** k / (np.pi * k) * sums[k * chosen] for k in range(1, HARMONICS + 1))
    peaks = find_peaks(along, height=0.0)[0]
    best = [peaks[np.argsort(worth[peaks])[::-1][:count]] for worth in (along, along * steps)]
    return [float(steps[k]) for k in dict.fromkeys(np.concatenate(best).tolist())]


def _coarse_steps(spread: float, peak: float) -> Array:
    """Steps too coarse for their rounding to be white, as far apart as it keeps its pattern; beyond the last one all is
    rounded to nothing."""
    found = [FINE * spread]
    while found[-1] < COARSEST * peak:
        found.append(found[-1] * (1 + min(NEAREST * found[-1] / spread, FARTHEST)))
    return np.array(found)


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
    """The quantiser with its step as the log shows it through its noise, else in the middle of where no row would be
    rounded otherwise."""
    found = Screened(one, _gain(base, one.at, one.values["step"]))
    if on_lattice(base.case, find_port(base.case.segment.loop, one.at)) is not None:
        return found
    exit = base.case.exit_at(one.at)
    column = np.concatenate([m[:, exit] for m in base.case.measured]) if exit is not None else np.zeros(0)
    if len(column) and (known := step_through_noise(column, one.values["step"])) is not None:
        shown = replace(one.moved({"step": known[0]}), errors={"step": max(known[1], FINEST * known[0])})
        return Screened(shown, _gain(base, one.at, known[0]))
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
