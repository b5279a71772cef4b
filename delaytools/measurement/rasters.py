"""Records of one run with rows at different times, brought to the rows of one of them, and said so."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from delaytools.signals.record import Record
from delaytools.signals.trouble import LogError

__all__ = ["at_times", "on_one_raster", "usual_step"]


def usual_step(record: Record) -> float:
    """The median distance of rows, s."""
    return float(np.median(np.diff(record.time)))


def at_times(record: Record, name: str, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """A signal at other times (s): held signals keep the last row's value, the others are interpolated linearly."""
    if name not in record.held:
        return np.interp(time, record.time, record[name])
    rows = np.searchsorted(record.time, time, side="right") - 1
    return record[name][np.clip(rows, 0, len(record) - 1)]


def on_one_raster(records: Sequence[Record], *, wanted: frozenset[str], whole: frozenset[str]) -> Record:
    """All signals at the rows of the fastest record that holds a wanted signal, where the wanted ones overlap.

    Signals in `whole` (whole numbers in the log) are held. `source` says what was interpolated and left out.
    Raises LogError where the records share no time.
    """
    asked = [record for record in records if wanted & set(record.names)] or list(records)
    base = min(asked, key=usual_step)
    start, end = max(r.time[0] for r in asked), min(r.time[-1] for r in asked)
    kept = base.between(start, end)
    if len(kept) < 2:
        spans = "; ".join(f"{_names(r)} from {r.time[0]:g} to {r.time[-1]:g} s" for r in asked)
        path = base.source.split("; ")[0]
        raise LogError("the groups of this log share no time", where=path, found=spans, advice="split it")
    columns: dict[str, NDArray[np.float64]] = {}
    units: dict[str, str] = {}
    held: set[str] = set()
    notes = [base.source, *(note for r in records if r is not base for note in r.source.split("; ")[1:])]
    for record in records:
        if record.time[0] > kept.time[0] or record.time[-1] < kept.time[-1]:
            notes.append(f"left out: {_names(record)} (not logged from {start:g} to {end:g} s)")
            continue
        if record is not base and not np.array_equal(record.time, base.time):
            held |= whole & set(record.names)
            notes.append(_resampled(record, base, held | record.held))
        held |= record.held
        source = Record(record.time, record.columns, record.units, frozenset(held & set(record.names)))
        columns |= {name: at_times(source, name, kept.time) for name in record.names}
        units |= record.units
    if len(kept) < len(base):
        notes.append(f"left out: {len(base) - len(kept)} rows at which not all signals are logged")
    return Record(kept.time, columns, units, frozenset(held), "; ".join(notes))


def _resampled(record: Record, base: Record, held: set[str]) -> str:
    steps = f"from rows every {usual_step(record):g} s to rows every {usual_step(base):g} s"
    ways = {
        "interpolated linearly": [name for name in record.names if name not in held],
        "held": [name for name in record.names if name in held],
    }
    return ", ".join(f"{', '.join(names)} {way}" for way, names in ways.items() if names) + f" {steps}"


def _names(record: Record) -> str:
    return ", ".join(record.names) or "no signal"
