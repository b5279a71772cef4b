"""What a design says of its logs: pieces of rows that count, beginnings, held and smooth columns, configurations."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.design.build import build
from delaytools.design.design import Design
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.pieces import cut_rows, long_gaps
from delaytools.loop.loop import Loop
from delaytools.loop.values import value_paths, with_numbers
from delaytools.signals.expression import NUMPY, Expression
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError
from delaytools.signals.units import convert, quantity

__all__ = ["as_logged", "differing", "pieces_in_words", "pieces_of"]

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
    gaps = any(long_gaps(record).any() for record in records)
    if length is None and table.where is None and table.start == "rest" and not gaps:
        return ()
    found = tuple(cut_rows(r, _wanted(table.where, r), length) for r in records)
    for record, pieces in zip(records, found, strict=True):
        if not pieces:
            raise AnalysisError("no row of the log counts", where=record.source, found=table.where or "")
    return found


def pieces_in_words(
    design: Design, pieces: Sequence[Sequence[tuple[int, int]]], window: float | None
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


def differing(design: Design, configurations: Sequence[str | None]) -> tuple[Mapping[str, float], ...]:
    """Per log, the values by path in which its configuration differs from the first log's."""
    first = build(design, configurations[0])
    return tuple(_differing(first, build(design, name), name) for name in configurations)


def _differing(first: Loop, other: Loop, name: str | None) -> Mapping[str, float]:
    ours, theirs = value_paths(first), value_paths(other)
    if set(ours) != set(theirs):
        odd = sorted(set(ours) ^ set(theirs))
        raise AnalysisError(
            "logs together need configurations that differ in numbers alone", where=name or "", found=", ".join(odd)
        )
    named = {path: v for path, v in theirs.items() if path.startswith("parameters.") and v != ours[path]}
    moved = value_paths(with_numbers(first, named)) if named else ours
    return {**named, **{path: v for path, v in theirs.items() if v != moved[path]}}


def as_logged(
    case: Case,
    design: Design,
    pieces: tuple[tuple[tuple[int, int], ...], ...],
    numbers: tuple[Mapping[str, float], ...],
) -> Case:
    """The case with what the design says of its logs; `numbers` of other segments are left out."""
    known = value_paths(case.segment.loop)
    own = tuple({path: v for path, v in one.items() if path in known} for one in numbers)
    table = design.tables
    return replace(
        case,
        pieces=pieces,
        numbers=own if any(own) else (),
        substeps=table.simulation.substeps,
        smooth=case.smooth | frozenset(table.log.smooth),
    )
