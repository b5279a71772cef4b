"""What is odd about a log but no fault: what was left out or interpolated, gaps, rows that are not evenly spaced."""

import numpy as np

from delaytools.signals.record import Record

__all__ = ["log_notes"]

_GAP = 1.5  # of the usual step
_JITTER = 0.01  # of the usual step


def log_notes(record: Record) -> tuple[str, ...]:
    """Sentences on a log: what its `source` says after the path, where rows are missing, how uneven the rest is."""
    path, *said = record.source.split("; ")
    found = [f"{path}: {note}" for note in said]
    steps = np.diff(record.time)
    if len(steps) < 2:
        return tuple(found)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > _GAP * usual)
    if len(gaps):
        widest = int(gaps[np.argmax(steps[gaps])])
        found.append(
            f"{path}: {len(gaps)} gap{'s' if len(gaps) > 1 else ''} in time, the longest "
            f"{steps[widest]:g} s after row {widest + 2} (t = {record.time[widest]:g} s); "
            f"rows are usually {usual:g} s apart"
        )
    rest = np.delete(steps, gaps)
    if np.max(np.abs(rest - usual)) > _JITTER * usual:
        found.append(f"{path}: rows are unevenly spaced, {rest.min():g} to {rest.max():g} s apart")
    return tuple(found)
