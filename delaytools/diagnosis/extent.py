"""How much of the logs a search works on: too few rows show nothing, too many cost more than any budget."""

from collections.abc import Sequence
from pathlib import PurePath

import numpy as np

from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError

__all__ = ["searched_rows"]

FEWEST = 100  # rows: noise and the past of the inputs cannot be told apart by fewer
LEAST = 16  # rows of one log among several
MOST = 200_000  # rows of all logs together


def searched_rows(records: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    """The first rows of each log, as many as a search can work on, and what was left out in words.

    The first ones, since a run begins at rest, or as [log] says.
    Raises AnalysisError for a log of a few rows, and where nothing moves.
    """
    shortest = min(records, key=len)
    rows = sum(map(len, records))
    if rows < FEWEST or len(shortest) < LEAST:
        raise AnalysisError(
            f"a diagnosis needs {FEWEST} rows or more, {LEAST} of each log", where=shortest.source.split("; ")[0],
            found=f"{rows} in all, {len(shortest)} here", advice="log a longer run; compare works with fewer",
        )  # fmt: skip
    if not any(np.ptp(r[name]) > 0 for r in records for name in r.names):
        raise AnalysisError(
            "no column ever changes: a bench at rest shows nothing of what a design may lack",
            where=", ".join(_name(r) for r in records), advice="log a run in which something moves",
        )  # fmt: skip
    if sum(map(len, records)) <= MOST:
        return tuple(records), ()
    share = max(MOST // len(records), FEWEST)
    words = tuple(
        f"{_name(r)}: the search works on the first {share} of {len(r)} rows (to t = {r.time[share - 1]:g} s); "
        "cut the log to have another part searched"
        for r in records
        if len(r) > share
    )
    return tuple(r.rows(slice(share)) if len(r) > share else r for r in records), words


def _name(record: Record) -> str:
    return PurePath(record.source.split("; ")[0]).name or "the log"
