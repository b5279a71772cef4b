"""Candidates whose cost is no smooth function of their value: quantisation, resampling, dropped frames."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import Sampled
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.lattices import on_lattice, shown_as
from delaytools.diagnosis.places import Spot
from delaytools.diagnosis.screen import Base, Screened, response
from delaytools.diagnosis.views import View
from delaytools.diagnosis.wires import Way
from delaytools.estimation.noise_level import difference_noise
from delaytools.loop.port import find_port
from delaytools.signals.record import Record

__all__ = ["quantisations", "with_draws", "with_period_fitted", "with_step_fitted"]

Array = NDArray[np.float64]
KEPT, LOST = 1 - 1e-9, 0.0
RUNS = 900  # of a segment, while its dropped updates are sought one after the other
EXCESS = 1.05  # of the noise: a residual below it is not worth a search for quantisation further upstream
FINEST = 1e-7  # of a step: how well it is to be known
AROUND = 0.03  # of the best step: where a better one may lie
TRIED, TRIED_SLOWLY = 12, 4  # steps whose change is sent through the segment, by convolution and by runs
COARSE, SIZES = (0.05, 2.0), 25  # of the signal's spread: steps so large that their pattern needs no fine grid
NEAREST_STEPS, NEAREST_SHOWN = 0.003, 0.0004  # relative, between steps at a port inside, and at an exit itself
FINE = 0.1  # of a signal's spread: the rounding of a finer step is white
MOST_SHOWN = 6000
MOST_STEPS = 900  # of a quantiser that are tried at a port


def quantisations(base: Base, view: View, spots: Sequence[Spot]) -> list[Screened]:
    """The best step of a quantiser at every port: the lattice of the log where there is one, else a fine grid.

    In real runs the lattice alone: errors of the model hide the pattern by which a step further upstream shows.
    """
    found = []
    for spot in (s for s in spots if s.kind == "quantization"):
        signals = view.at(spot.port)
        if (one := on_lattice(base.case, spot.port)) is not None:
            change = response(base, one)
            found.extend([Screened(one, base.gain(change, 0.9, 1.1)[0])] if change is not None else [])
        elif not base.case.pieces and (best := _best_step(base, spot, signals)) is not None:
            found.append(best)
    return found


def _best_step(base: Base, spot: Spot, signals: tuple[Array, ...]) -> Screened | None:
    spread = float(np.std(np.concatenate(signals)))
    shown = shown_as(base.case, spot.port)
    left = base.case.measured[0] - base.outputs[0]
    if spread <= 0 or (shown is None and not _above_noise(base.case, left)):
        return None
    way = base.way(str(spot.port))
    if way is None or way.every == 0:  # no pulse speaks for all times: nothing to choose steps by
        return None
    size = _size_by_power(base, way) if shown is None else float(np.sqrt(12) * left[:, shown].std())
    if not 0 < size < np.inf:
        return None
    nearest = NEAREST_STEPS if shown is None else NEAREST_SHOWN
    high = max((3.0 if shown is None else 1.3) * size, COARSE[1] * spread)
    steps = _steps((spread, nearest), 0.25 * size, high, MOST_STEPS if shown is None else MOST_SHOWN)
    weights = way.weights(base.residual)
    promised = np.array([
        _promised(step, way, signals, weights) if shown is None or step > FINE * spread
        else 2 * _along(step, way, signals, weights) - step**2 / 12 * way.white_power
        for step in steps
    ])  # fmt: skip
    first = np.argsort(promised)[::-1][: TRIED if way.is_quick else TRIED_SLOWLY]
    tried = {float(steps[k]) for k in first if promised[k] > 0}
    if way.is_quick and shown is None:
        tried |= {float(step) for step in np.geomspace(*COARSE, SIZES) * spread}
    gains = {step: _gain(base, spot.kind, str(spot.port), step) for step in tried}
    top = max(gains, key=gains.__getitem__, default=0.0)
    if gains.get(top, 0.0) <= 0:
        return None
    return _finer(base, spot.kind, str(spot.port), (top, AROUND * top), slowly=not way.is_quick)


def _finer(
    base: Base, kind: str, at: str, range_of: tuple[float, float], *, slowly: bool = False
) -> Screened:
    """The best step within middle ± width, as good as a grid shows."""
    middle, width = range_of
    tried = middle + width * np.linspace(-1, 1, 13 if slowly else 61)
    gains = np.array([_gain(base, kind, at, step) for step in tried])
    best = int(np.argmax(gains))
    sure = tried[gains >= gains[best] - 4.0]
    error = max((sure[-1] - sure[0]) / 4, (tried[1] - tried[0]) / 2)
    one = Added(kind, at, {"step": float(tried[best])}, {}, frozenset({"step"}), {}, {"step": float(error)})
    return Screened(one, float(gains[best]))


def with_step_fitted(base: Base, one: Added) -> Screened:
    """The quantiser with its step so fine that no row is rounded otherwise by what is left of its error."""
    found = Screened(one, _gain(base, one.kind, one.at, one.values["step"]))
    if on_lattice(base.case, find_port(base.case.segment.loop, one.at)) is not None:
        return found
    way = base.way(one.at)
    while way is not None and way.is_quick and found.added.errors["step"] > FINEST * found.added.values["step"]:
        middle, width = found.added.values["step"], 2 * found.added.errors["step"]
        finer = _finer(base, one.kind, one.at, (middle, width))
        if finer.added.errors["step"] > 0.5 * found.added.errors["step"]:
            return max(found, finer, key=lambda screened: screened.gain)
        found = finer
    return found


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
        power = np.abs(np.fft.rfft(way.read(step * np.floor(u / step + 0.5) - u))) ** 2 * gain
        found -= float(2 * power.sum() - power[0]) / len(u)
    return found


def _along(step: float, way: Way, signals: tuple[Array, ...], weights: tuple[Array, ...]) -> float:
    """How far a quantiser's change moves the exits along the residual."""
    return sum(
        float(way.read(step * np.floor(u / step + 0.5) - u) @ w) for u, w in zip(signals, weights, strict=True)
    )


def _steps(signal: tuple[float, float], low: float, high: float, most: int) -> Array:
    """Steps as far apart as the rounding of a signal keeps its pattern; signal: its spread, and the nearest ratio."""
    (spread, nearest), found = signal, [low]
    while found[-1] < high and len(found) < most:
        found.append(found[-1] * (1 + np.clip(0.08 * found[-1] / spread, nearest, 0.03)))
    return np.array(found)


def _gain(base: Base, kind: str, at: str, step: float) -> float:
    change = response(base, Added(kind, at, {"step": float(step)}))
    return 0.0 if change is None else base.gain(change, 0.9, 1.1)[0]


def with_period_fitted(base: Base, one: Added, name: str = "period") -> Screened:
    """The resampling with the whole number of rows about its period that takes most off."""
    rows = one.values[name] / base.case.step
    best = Screened(one, 0.0)
    for count in range(max(1, int(0.55 * rows)), int(1.7 * rows) + 2):
        moved = replace(
            one.moved({name: count * base.case.step}),
            held=frozenset({name}),
            errors={name: 1e-4 * base.case.step},
        )
        change = response(base, moved)
        gain = 0.0 if change is None else base.gain(change, 0.5, 2.0)[0]
        if gain > best.gain:
            best = Screened(moved, gain)
    return best


def with_draws(case: Case) -> Case:
    """The case with the column of draws that dropped frames would need at every sampled output, and their shares."""
    exits = [j for j, exit in enumerate(case.exits) if exit in case.records[0].held]
    shares: dict[str, float] = {}
    if len(exits) != len(case.exits):
        return case
    for name in case.segment.blocks:
        element = case.segment.loop[name]
        if isinstance(element.block, Sampled):
            for port in element.outputs:
                at = f"{name}.{port}"
                case, shares[at] = _drawn(case, at, float(element.block.period))
    return replace(case, lost=shares, _replays={})


def _drawn(case: Case, at: str, period: float) -> tuple[Case, float]:
    column = f"dropped_frames@{at}.draw"
    one = Added("dropped_frames", at, {"probability": 0.5}, {}, frozenset({"probability"}))
    records, lost, ticks = [], 0, 0
    nominal = tuple(p.value for p in case.parameters(()))
    for log, record in enumerate(case.records):
        time = record.time - record.time[0]
        instants = np.arange(0, time[-1] + 1e-9, period) + 1e-3 * case.step
        rows = np.unique(np.searchsorted(time, instants, side="right") - 1)  # one where a gap hides several
        flags = np.full(len(record), KEPT)
        exit = shown_as(case, find_port(case.segment.loop, at))
        if exit is not None:
            flags = _decided_at_once(case, (one, nominal), (log, column, rows), exit)
        else:
            flags = _decided(case, (one, nominal), (log, column, rows), flags)
        lost, ticks = lost + int(np.sum(flags[rows] == LOST)), ticks + len(rows)
        records.append(_carrying(record, column, flags))
    return replace(case, records=tuple(records), _replays={}), lost / max(ticks, 1)


def _carrying(record: Record, column: str, flags: Array) -> Record:
    held = record.held | {column}
    return Record(record.time, {**record.columns, column: flags}, record.units, held, record.source)


def _with_draws_of(
    case: Case, model: tuple[Added, tuple[float, ...]], place: tuple[int, str], flags: Array
) -> Array:
    """(n, exits): one log as the model gives it with these draws."""
    (one, nominal), (log, column) = model, place
    record = _carrying(case.records[log], column, flags)
    tried = replace(case, records=(record,), measured=(case.measured[log],), _replays={})
    return tried.outputs((one,), nominal)[0]


def _decided_at_once(
    case: Case, model: tuple[Added, tuple[float, ...]], place: tuple[int, str, NDArray[np.int64]], exit: int
) -> Array:
    """The draws of one log where the port is measured: an update is lost where the old value stands instead of it.

    All kept where some value is neither.
    """
    log, column, rows = place
    measured = case.measured[log]
    limit = 1e-4 * float(measured[:, exit].std()) + 1e-12
    flags = np.full(len(measured), KEPT)

    def wrong() -> NDArray[np.bool_]:
        outputs = _with_draws_of(case, model, (log, column), flags)
        return np.asarray(np.abs(outputs[:, exit] - measured[:, exit]) > limit)

    stale = np.abs(np.diff(measured[:, exit], prepend=np.nan)) <= limit
    odd = rows[wrong()[rows]]
    if not np.all(stale[odd]) or len(odd) > 0.5 * len(rows):
        return flags
    flags[odd] = LOST
    return np.full(len(flags), KEPT) if np.any(wrong()) else flags


def _decided(
    case: Case,
    model: tuple[Added, tuple[float, ...]],
    place: tuple[int, str, NDArray[np.int64]],
    flags: Array,
) -> Array:
    """The draws of one log, update by update: where model and log part, the update is taken to be lost."""
    log, column, rows = place
    measured = case.measured[log]
    limit = 1e-4 * measured.std(axis=0) + 1e-12
    first_wrong = -1
    for _ in range(RUNS):
        outputs = _with_draws_of(case, model, (log, column), flags)
        wrong = np.flatnonzero(np.any(np.abs(outputs - measured) > limit, axis=1))
        if not len(wrong):
            return flags
        tick = rows[np.searchsorted(rows, wrong[0], side="right") - 1]
        if flags[tick] == LOST or tick <= first_wrong:
            return np.full(len(flags), KEPT)
        flags[tick] = LOST
        first_wrong = int(tick)
        if first_wrong == tick == rows[0] or np.sum(flags == LOST) > 0.5 * len(rows):
            return np.full(len(flags), KEPT)
    return np.full(len(flags), KEPT)
