"""From what stands in a file to a record: columns of numbers, time, units, and everything that is wrong with them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from delaytools.measurement.formats.table import Table
from delaytools.measurement.log_checks import check_names, finite, left_out_note, rising, unit_error
from delaytools.measurement.rasters import on_one_raster
from delaytools.signals.record import Record
from delaytools.signals.trouble import LogError, UnitError
from delaytools.signals.units import convert

__all__ = ["Columns", "log_record"]


@final
@dataclass(frozen=True)
class Columns:
    """How a log's columns map to signals: the time column, column -> signal, signal -> unit wanted, held signals.

    A log may also name its columns as the signals are named, and its time `time`, as a simulated one does.
    """

    time: str = "time"
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    held: frozenset[str] = frozenset()

    def signal(self, column: str) -> str:
        """The signal that a column carries."""
        return self.columns.get(column, column)

    def needs(self, column: str) -> bool:
        """Whether a design asks for the column."""
        return column in self.columns or self.signal(column) in self.units


def log_record(path: str, table: Table, mapping: Columns) -> Record:
    """The record of a file's tables, in the units that the mapping wants; raises LogError for a faulty log."""
    tables = _named_apart([table, *table.further])
    check_names(path, tables, mapping)
    clocks = [_clock(one, mapping) for one in tables]
    if not any(clocks):
        known = [name for one in tables for name in one.names]
        where = ", ".join(part for part in (path, table.head) if part)
        found, advice = f"no column named {mapping.time}", 'name it under [log] as time = "…"'
        raise LogError("no time column", where=where, found=found, known=known, advice=advice)
    records = [_record(path, one, clock, mapping) for one, clock in _joined(tables, clocks)]
    if len(records) == 1:
        return records[0]
    whole = frozenset(mapping.signal(n) for t in tables for n, c in _pairs(t) if c.dtype.kind in "biu")
    wanted = frozenset(mapping.units) | frozenset(mapping.columns.values())
    return on_one_raster(records, wanted=wanted, whole=whole)


def _pairs(table: Table) -> list[tuple[str, NDArray[Any]]]:
    return list(zip(table.names, table.columns, strict=True))


def _named_apart(tables: list[Table]) -> list[Table]:
    """Tables whose columns' names differ: a name that several tables have is written PLACE/NAME."""
    if len(tables) == 1:
        return tables
    every = [name for table in tables for name in table.names]
    found = []
    for table in tables:
        names = tuple(
            f"{table.place}/{name}" if table.place and every.count(name) > 1 else name for name in table.names
        )
        clock = names[table.names.index(table.clock)] if table.clock else ""
        found.append(Table(names, table.units, table.columns, clock, table.place, table.head, table.row_of))
    return found


def _clock(table: Table, mapping: Columns) -> str:
    """The table's time column: as mapped, or `time` as simulated logs have it, or what the format says."""
    for wanted in (mapping.time, "time"):
        for name in (wanted, f"{table.place}/{wanted}"):
            if name in table.names:
                return name
    return table.clock


def _joined(tables: list[Table], clocks: list[str]) -> list[tuple[Table, str]]:
    """Each table that has a time, and in the first one the columns of those that have none."""
    timed = [(table, clock) for table, clock in zip(tables, clocks, strict=True) if clock]
    bare = [table for table, clock in zip(tables, clocks, strict=True) if not clock]
    first, clock = timed[0]
    every = [first, *bare]
    whole = Table(
        tuple(name for one in every for name in one.names),
        tuple(unit for one in every for unit in one.units),
        tuple(column for one in every for column in one.columns),
        clock,
        first.place,
        first.head,
        first.row_of,
    )
    return [(whole, clock), *timed[1:]]


def _record(path: str, table: Table, clock: str, mapping: Columns) -> Record:
    time, notes = _time(path, table, clock)
    columns, units, lost = {}, {}, {}
    for (name, array), unit in zip(_pairs(table), table.units, strict=True):
        if name == clock:
            continue
        parts, reason = _numbers(name, array, len(time))
        if reason:
            lost[name] = reason
        if reason and mapping.needs(name):
            where, advice = f"{path}, column {name}", "the design needs it"
            raise LogError("not a column of numbers", where=where, found=reason, advice=advice)
        for part, values in parts.items():
            finite(path, table, part, values)
            signal = mapping.signal(part)
            wanted = mapping.units.get(signal)
            columns[signal], units[signal] = _converted(path, table, part, (values, unit), wanted)
    source = "; ".join((path, *notes, *left_out_note(lost)))
    return Record(time, columns, units, mapping.held & frozenset(columns), source)


def _time(path: str, table: Table, clock: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    index = table.names.index(clock)
    array, unit = np.squeeze(table.columns[index]), table.units[index]
    notes: tuple[str, ...] = ()
    if array.dtype.kind in "mM":
        if array.dtype.kind == "M" and array.size:
            notes = (f"time is counted from {array.flat[0]}",)
            array = array - array.flat[0]
        array, unit = array / np.timedelta64(1, "s"), "s"
    where = f"{path}, column {clock}"
    if array.dtype.kind not in "biuf":
        raise LogError("time is not a column of numbers", where=where, found=_kind(array))
    if array.size < 2:
        one = "a log has two rows or more, this one has one"
        none = "a header but no rows" if table.head else "no rows"
        raise LogError(one if array.size else none, where=path, advice="is the log truncated?")
    if array.ndim != 1:
        raise LogError("time is not one column", where=where, found=f"an array of {array.shape}")
    time, _ = _converted(path, table, clock, (array, unit or "s"), "s")
    finite(path, table, clock, time, problem="time is not a finite number")
    rising(path, table, clock, time)
    return time, notes


def _numbers(name: str, array: NDArray[Any], rows: int) -> tuple[dict[str, NDArray[Any]], str]:
    """The column, or the columns name[0], name[1], … of a table; else nothing and why."""
    if array.dtype.kind not in "biuf":
        return {}, _kind(array)
    if array.size == rows:
        return {name: array.reshape(-1)}, ""
    if array.ndim == 2 and rows in array.shape:
        table = array if array.shape[0] == rows else array.T
        return {f"{name}[{k}]": table[:, k] for k in range(table.shape[1])}, ""
    size = "one value" if array.size == 1 else f"an array of {'×'.join(map(str, array.shape))}"
    return {}, f"{size} where time has {rows} rows"


def _kind(array: NDArray[Any]) -> str:
    words = {"c": "complex numbers", "S": "text", "U": "text", "M": "dates", "m": "durations"}
    return words.get(array.dtype.kind, "no array of numbers")


def _converted(
    path: str, table: Table, name: str, column: tuple[NDArray[Any], str], wanted: str | None
) -> tuple[NDArray[np.float64], str]:
    values, unit = column
    if wanted is None or unit in ("", wanted):
        return np.asarray(values, dtype=float), unit or (wanted or "")
    try:
        factor = convert(1.0, unit, wanted)
    except UnitError as error:
        raise unit_error(path, table, name, unit, wanted) from error
    return values * factor, wanted
