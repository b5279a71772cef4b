"""Candidates whose cost is no smooth function of their value: quantisation, resampling, dropped frames."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import Sampled
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.places import Spot
from delaytools.diagnosis.screen import Base, Screened, response
from delaytools.diagnosis.views import View
from delaytools.estimation.noise_level import difference_noise
from delaytools.loop.port import Port
from delaytools.signals.record import Record

__all__ = ["lattice_step", "quantisations", "with_draws", "with_period_fitted"]

Array = NDArray[np.float64]
KEPT, LOST = 1 - 1e-9, 0.0
RUNS = 900  # of a segment, while its dropped updates are sought one after the other
EXCESS = 1.05  # of the noise: a residual below it is not worth a search for quantisation further upstream
MOST_STEPS = 400  # of a quantiser that are tried at a port


def lattice_step(values: Array) -> float:
    """The step of the lattice on which all values (n,) lie, or 0 where there is none."""
    found = np.unique(values)
    if len(found) < 3 or len(found) > 0.5 * len(values):
        return 0.0
    steps = np.diff(found)
    steps = steps[steps > 1e-7 * np.abs(found).max()]
    if not len(steps):
        return 0.0
    step = float(steps.min())
    counts = np.round((found - found[0]) / step)
    step = float(np.polyfit(counts, found, 1)[0])
    off = np.abs(found / step - np.round(found / step))
    return step if off.max() < 0.02 and np.ptp(found) / step < 2000 else 0.0


def quantisations(base: Base, view: View, spots: Sequence[Spot]) -> list[Screened]:
    """The best step of a quantiser at every port: the lattice of the log where there is one, else a fine grid.

    In real runs the lattice alone: errors of the model hide the pattern by which a step further upstream shows.
    """
    found = []
    for spot in (s for s in spots if s.kind == "quantization"):
        signals = view.at(spot.port)
        shown = _shown_at(base.case, spot.port)
        lattice = lattice_step(base.case.measured[0][:, shown]) if shown is not None else 0.0
        if lattice:
            one = Added(
                spot.kind,
                str(spot.port),
                {"step": lattice},
                {},
                frozenset({"step"}),
                {},
                {"step": 1e-4 * lattice},
            )
            change = response(base, one)
            found.extend([Screened(one, base.gain(change, 0.9, 1.1)[0])] if change is not None else [])
        elif not base.case.pieces and (best := _best_step(base, spot, signals)) is not None:
            found.append(best)
    return found


def _shown_at(case: Case, port: Port) -> int | None:
    """The exit that the port itself is, if it is one."""
    element = case.segment.loop[port.element]
    if port.kind == "output" and element.outputs[port.name] in case.exits:
        return case.exits.index(element.outputs[port.name])
    return None


def _best_step(base: Base, spot: Spot, signals: tuple[Array, ...]) -> Screened | None:
    spread = float(np.std(np.concatenate(signals)))
    shown = _shown_at(base.case, spot.port)
    left = base.case.measured[0] - base.outputs[0]
    share = float(np.mean(left.std(axis=0) / np.maximum(base.case.measured[0].std(axis=0), 1e-300)))
    size = np.sqrt(12) * (float(left[:, shown].std()) if shown is not None else share * spread)
    if spread <= 0 or size <= 0 or (shown is None and not _above_noise(base.case, left)):
        return None
    way = base.way(str(spot.port))
    if way is None:
        return None
    steps = _steps(spread, 0.25 * size, (1.3 if shown is not None else 6.0) * size, MOST_STEPS)
    weights = way.weights(base.residual)
    gains = [_speaking_for(step, signals, weights) for step in steps]
    top = int(np.argmax(gains))
    if gains[top] <= 0:
        return None
    apart = steps[top] - steps[top - 1] if top else steps[1] - steps[0]
    near = steps[top] + apart * np.linspace(-1, 1, 31 if way.is_quick else 9)
    fine = np.array([_gain(base, spot, step) for step in near])
    best = int(np.argmax(fine))
    sure = near[fine >= fine[best] - 4.0]
    error = max((sure[-1] - sure[0]) / 4, apart / 60)
    values = {"step": float(near[best])}
    one = Added(spot.kind, str(spot.port), values, {}, frozenset({"step"}), {}, {"step": float(error)})
    return Screened(one, float(fine[best]))


def _above_noise(case: Case, left: Array) -> bool:
    """Whether the residual of an exit is more than the noise that its fourth differences show."""
    noises = [difference_noise(column) for column in case.measured[0].T]
    held = [exit in case.records[0].held for exit in case.exits]
    return any(
        h or rms > EXCESS * noise for h, rms, noise in zip(held, left.std(axis=0), noises, strict=True)
    )


def _speaking_for(step: float, signals: tuple[Array, ...], weights: tuple[Array, ...]) -> float:
    """How well what a quantiser changes goes with the residual, over its own size (which is what white noise has)."""
    up, power = 0.0, 0.0
    for u, w in zip(signals, weights, strict=True):
        change = step * np.floor(u / step + 0.5) - u
        up, power = up + float(change @ w), power + float(change @ change)
    return max(up, 0.0) ** 2 / power if power > 0 else 0.0


def _steps(spread: float, low: float, high: float, most: int) -> Array:
    """Steps as far apart as the rounding of a signal of this spread keeps its pattern."""
    found = [low]
    while found[-1] < high and len(found) < most:
        found.append(found[-1] * (1 + np.clip(0.08 * found[-1] / spread, 0.003, 0.03)))
    return np.array(found)


def _gain(base: Base, spot: Spot, step: float) -> float:
    change = response(base, Added(spot.kind, str(spot.port), {"step": float(step)}))
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
        flags = _decided(case, (one, nominal), (log, column, rows), flags)
        lost, ticks = lost + int(np.sum(flags[rows] == LOST)), ticks + len(rows)
        records.append(_carrying(record, column, flags))
    return replace(case, records=tuple(records), _replays={}), lost / max(ticks, 1)


def _carrying(record: Record, column: str, flags: Array) -> Record:
    held = record.held | {column}
    return Record(record.time, {**record.columns, column: flags}, record.units, held, record.source)


def _decided(
    case: Case,
    model: tuple[Added, tuple[float, ...]],
    place: tuple[int, str, NDArray[np.int64]],
    flags: Array,
) -> Array:
    """The draws of one log, update by update: where model and log part, the update is taken to be lost."""
    one, nominal = model
    log, column, rows = place
    measured = case.measured[log]
    limit = 1e-4 * measured.std(axis=0) + 1e-12
    first_wrong = -1
    for _ in range(RUNS):
        tried = replace(
            case, records=(_carrying(case.records[log], column, flags),), measured=(measured,), _replays={}
        )
        outputs = tried.outputs((one,), nominal)[0]
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
