"""Candidates that act at ticks, so that no derivative fits them: resampling and dropped frames."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import Sampled
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.screen import Base, Screened, response
from delaytools.loop.values import resolve
from delaytools.signals.record import Record

__all__ = ["loses_updates", "with_draws", "with_period_fitted"]

Array = NDArray[np.float64]
Model = tuple[tuple[Added, ...], tuple[float, ...]]  # a hypothesis and its values
KEPT, LOST = 1 - 1e-9, 0.0
LONGEST = 200  # rows of a resampling's period
BEYOND = 1.5  # times the most that a hypothesis misses a new value by
MOST_LOST = 0.9  # of the updates
RUNS = 900  # of a segment, while its dropped updates are sought one after the other


def with_period_fitted(base: Base, one: Added, name: str = "period") -> Screened:
    """The resampling with the whole number of rows up to about its period that takes most off.

    Where a segment integrates, the best one stands far above its neighbours: all are tried where that costs little.
    After the deadline the best of those that were tried.
    """
    rows = one.values[name] / base.case.step
    best, way = Screened(one, 0.0), base.way(one.at)
    count = 1 if way is not None and way.is_quick else max(1, int(0.55 * rows))
    last = int(1.7 * rows) + 1
    while count <= min(last, LONGEST) and not base.case.is_late:
        moved = replace(
            one.moved({name: count * base.case.step}),
            held=frozenset({name}),
            errors={name: 1e-4 * base.case.step},
        )
        change = response(base, moved)
        half = 0.5 / count  # half a row more delays by so much more: a wider scale would let every period do
        gain = 0.0 if change is None else base.gain(change, 1 - half, 1 + half)[0]
        if gain > best.gain:
            best, last = Screened(moved, gain), max(last, int(1.7 * count))  # what still rises is not left at an end
        count += 1
    return best


def with_draws(case: Case, fitted: Fitted | None = None) -> Case:
    """The case with the column of draws that dropped frames would need at every sampled output, and their shares.

    fitted: beside which hypothesis (default: as designed).
    """
    shares: dict[str, float] = {}
    if not set(case.exits) <= case.records[0].held:
        return case
    for at, period in _sampled_outputs(case):
        case, share = _drawn(case, at, period, fitted)
        if _column_of(at) not in case.segment.loop.random:
            shares[at] = share
    return replace(case, lost=shares, _replays={})


def loses_updates(case: Case) -> bool:
    """Whether the exits of a computer are met exactly but for updates that were lost where they leave it."""
    if not set(case.exits) <= case.records[0].held:
        return False
    shown = [(at, period) for at, period in _sampled_outputs(case) if case.exit_at(at) is not None]
    return any(_drawn(case, at, period)[1] > 0 for at, period in shown)


def _sampled_outputs(case: Case) -> list[tuple[str, float]]:
    """Every output of a sampled block, and the block's period in s."""
    resolved = resolve(case.segment.loop)
    blocks = ((name, resolved[name].block) for name in case.segment.blocks)
    return [
        (f"{name}.{port}", float(block.period))
        for name, block in blocks if isinstance(block, Sampled) for port in resolved[name].outputs
    ]  # fmt: skip


def _column_of(at: str) -> str:
    """The column that says which updates of a port are lost."""
    return f"dropped_frames@{at}.draw"


def _drawn(case: Case, at: str, period: float, fitted: Fitted | None = None) -> tuple[Case, float]:
    """The case with the draws of a port, of the design's own dropped frames where it has them; the share lost."""
    added, values = (fitted.added, fitted.values) if fitted else ((), tuple(p.value for p in case.parameters(())))
    column = _column_of(at)
    designed = column in case.segment.loop.random
    dropped = Added("dropped_frames", at, {"probability": 0.5}, {}, frozenset({"probability"}))
    model = (added if designed else (*added, dropped)), values
    roughly = fitted is not None
    records, lost, ticks = [], 0, 0
    for log, record in enumerate(case.records):
        time = record.time - record.time[0]
        instants = np.arange(0, time[-1] + 1e-9, period) + 1e-3 * case.step
        rows = np.unique(np.searchsorted(time, instants, side="right") - 1)  # one where a gap hides several
        flags = np.full(len(record), KEPT)
        exit = case.exit_at(at)
        if exit is not None:
            flags = _decided_at_once(case, model, (log, column, rows), exit, roughly=roughly)
        else:
            flags = _decided(case, model, (log, column, rows), flags)
        lost, ticks = lost + int(np.sum(flags[rows] == LOST)), ticks + len(rows)
        records.append(_carrying(record, column, flags))
    return replace(case, records=tuple(records), _replays={}), lost / max(ticks, 1)


def _carrying(record: Record, column: str, flags: Array) -> Record:
    held = record.held | {column}
    return Record(record.time, {**record.columns, column: flags}, record.units, held, record.source)


def _with_draws_of(case: Case, model: Model, place: tuple[int, str], flags: Array) -> Array:
    """(n, exits): one log as the model gives it with these draws."""
    log, column = place
    record = _carrying(case.records[log], column, flags)
    return replace(case, records=(record,), measured=(case.measured[log],), _replays={}).outputs(*model)[0]


def _decided_at_once(
    case: Case, model: Model, place: tuple[int, str, NDArray[np.int64]], exit: int, *, roughly: bool
) -> Array:
    """The draws of one log where the port is measured: an update is lost where the old value stands instead of it.

    All kept where some value is neither. roughly: what a hypothesis misses by where values are new, it may miss
    everywhere.
    """
    log, column, rows = place
    measured = case.measured[log]
    exact = 1e-4 * float(measured[:, exit].std()) + 1e-12
    flags = np.full(len(measured), KEPT)

    def missed() -> Array:
        outputs = _with_draws_of(case, model, (log, column), flags)
        return np.asarray(np.abs(outputs[:, exit] - measured[:, exit]))

    stale = np.abs(np.diff(measured[:, exit], prepend=measured[0, exit])) <= exact  # what stood before is not logged
    off, fresh = missed(), rows[~stale[rows]]
    limit = max(exact, BEYOND * float(off[fresh].max(initial=0.0))) if roughly else exact
    odd = rows[off[rows] > limit]
    if not np.all(stale[odd]) or not np.any(odd > rows[0]) or len(odd) > MOST_LOST * len(rows):
        return flags
    flags[odd] = LOST
    return np.full(len(flags), KEPT) if np.any(missed() > limit) else flags


def _decided(
    case: Case,
    model: Model,
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
        if tick == rows[0] or np.sum(flags == LOST) > MOST_LOST * len(rows):
            return np.full(len(flags), KEPT)
    return np.full(len(flags), KEPT)
