"""Logs in pieces, as [log] says: the rows that count, parted where states begin anew."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from delaytools.design.design import Design
from delaytools.signals.expression import NUMPY, Expression
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError
from delaytools.signals.units import convert, quantity

__all__ = ["counting_rows", "pieces_in_words", "pieces_of"]

SHORTEST = 8  # rows
LONG = 5  # usual steps: what drives the bench in a longer gap between rows is not known
_COMPARED = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}
_COMPARISON = re.compile(r"(.+?)(<=|>=|<|>)(.+)")


def pieces_of(
    design: Design, records: Sequence[Record], window: float | None = None
) -> tuple[tuple[tuple[int, int], ...], ...]:
    """Per log the rows that count, as [log] says (`window`, `where`, `start`), parted at long gaps.

    () where that is all, from rest.
    """
    table = design.tables.log
    length = window or _seconds(table.window)
    gaps = any(_long_gaps(record).any() for record in records)
    if length is None and table.where is None and table.start == "rest" and not gaps:
        return ()
    found = tuple(_cut_rows(r, _wanted(table.where, r), length) for r in records)
    for record, pieces in zip(records, found, strict=True):
        if not pieces:
            raise AnalysisError("no row of the log counts", where=record.source, found=table.where or "")
    return found


def counting_rows(record: Record, pieces: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """(n,) which rows of a log count; all where there are no pieces."""
    found = np.full(len(record), not pieces)
    for first, last in pieces:
        found[first:last] = True
    return found


def pieces_in_words(
    design: Design, pieces: Sequence[Sequence[tuple[int, int]]], window: float | None = None
) -> tuple[str, ...]:
    """Notes for an answer on what was made of the logs."""
    if not pieces:
        return ()
    length = window or _seconds(design.tables.log.window)
    words = ["the states at the beginning of each log, and after long gaps, are fitted: not taken to be at rest"]
    if length is not None:
        words = [f"every log is compared in pieces of {length:g} s whose beginnings are fitted: errors do not add up"]
    if design.tables.log.where is not None:
        words.append(f"only rows with {design.tables.log.where} count")
    return tuple(words)


def _seconds(raw: float | str | None) -> float | None:
    if raw is None or isinstance(raw, int | float):
        return raw
    parts = quantity(raw)
    if parts is None:
        raise AnalysisError("a time is wanted here", where="log.window", found=repr(raw), advice='write "1 s"')
    return float(convert(parts[0], parts[1], "s"))


def _wanted(where: str | None, record: Record) -> NDArray[np.bool_]:
    """Rows for which every comparison of `where` holds."""
    wanted = np.ones(len(record), dtype=bool)
    for part in (where or "").split(" and "):
        if not part.strip():
            continue
        match = _COMPARISON.fullmatch(part.strip())
        if match is None:
            raise AnalysisError("no comparison", where="log.where", found=repr(part), advice='write "speed > 0.8"')
        left, right = (np.asarray(_values(match[k], record)) for k in (1, 3))
        wanted &= np.broadcast_to(_COMPARED[match[2]](left, right), wanted.shape)
    return wanted


def _values(text: str, record: Record) -> object:
    formula = Expression(text.strip())
    for name in formula.names:
        if name not in record:
            raise AnalysisError("no such column", where="log.where", found=repr(name), known=record.names)
    return formula.evaluate({name: record[name] for name in formula.names}, NUMPY)


def _cut_rows(record: Record, wanted: NDArray[np.bool_], window: float | None) -> tuple[tuple[int, int], ...]:
    """(first, last + 1) of stretches of wanted rows: none longer than the window (s), of a few rows, across a gap."""
    time = record.time - record.time[0]
    part = np.floor(time / window + 1e-9).astype(int) if window else np.zeros(len(time), dtype=int)
    cuts = (np.diff(part) != 0) | (np.diff(wanted.astype(int)) != 0) | _long_gaps(record)
    label = np.cumsum(np.concatenate([[0], cuts]))
    edges = np.concatenate([[0], np.flatnonzero(np.diff(label)) + 1, [len(time)]])
    pairs = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    return tuple((a, b) for a, b in pairs if wanted[a] and b - a >= SHORTEST)


def _long_gaps(record: Record) -> NDArray[np.bool_]:
    """(n - 1,) whether the next row is so far that nobody knows what the bench did until then."""
    steps = np.diff(record.time)
    return np.asarray(steps > LONG * np.median(steps))
