"""The door for logs: a CSV file with a header of `name` or `name[unit]`, as a Record, and back."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.signals.record import Record
from delaytools.signals.trouble import LogError, UnitError
from delaytools.signals.units import convert

__all__ = ["Columns", "read_log", "write_log"]

_HEADER = re.compile(r"^\s*(.*?)\s*(?:\[(.*?)\])?\s*$")


@final
@dataclass(frozen=True)
class Columns:
    """How a log's columns map to signals: the time column, column -> signal, signal -> unit wanted, held signals."""

    time: str = "time"
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    held: frozenset[str] = frozenset()


def read_log(path: str | Path, mapping: Columns | None = None) -> Record:
    """The record in a CSV file, in the units that the mapping wants.

    Raises LogError that names file, row and column: a file that is not there, empty or truncated, a column that is
    missing, NaN, time that does not increase, a unit of the wrong dimension.
    """
    path, mapping = Path(path), mapping or Columns()
    names, table = _table(path)
    heads = [_HEADER.match(name) for name in names]
    plain = [head.group(1) if head else name for head, name in zip(heads, names, strict=True)]
    units = [(head.group(2) or "") if head else "" for head in heads]
    _no_doubles(path, plain)
    time = _time(path, plain, units, table, mapping.time)
    columns, found = {}, {}
    for index, (name, unit) in enumerate(zip(plain, units, strict=True)):
        if name == mapping.time:
            continue
        signal = mapping.columns.get(name, name)
        columns[signal], found[signal] = _converted(
            path, name, table[:, index], unit, mapping.units.get(signal)
        )
    _check_finite(path, columns)
    missing = [column for column in mapping.columns if column not in plain]
    if missing:
        raise LogError("missing column", where=str(path), found=f"no {missing[0]}", known=plain)
    return Record(time, columns, found, mapping.held & frozenset(columns), str(path))


def _table(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    try:
        with path.open(encoding="utf-8-sig") as file:
            header = file.readline().strip()
            if not header:
                raise LogError("the file is empty", where=str(path), advice="a log begins with a header row")
            table = np.loadtxt(file, delimiter=",", ndmin=2, comments=None)
    except FileNotFoundError as error:
        here = sorted(p.name for p in path.parent.glob("*.csv")) if path.parent.is_dir() else []
        raise LogError("no such file", where=str(path), found=path.name, known=here) from error
    except UnicodeDecodeError as error:
        raise LogError("not a text file", where=str(path), advice="give a CSV file") from error
    except ValueError as error:
        raise _unreadable(path, str(error)) from error
    names = header.split(",")
    if table.size == 0:
        raise LogError("a header but no rows", where=str(path), advice="is the log truncated?")
    if table.shape[1] != len(names):
        raise LogError(
            "rows and header differ in length",
            where=str(path),
            found=f"{table.shape[1]} values, {len(names)} names",
        )
    return names, table


def _unreadable(path: Path, message: str) -> LogError:
    place = re.search(r"string '(.*?)' to float64 at row (\d+), column (\d+)", message)
    if place:
        text, row, column = place.group(1), int(place.group(2)) + 2, place.group(3)
        problem = "an empty cell" if not text.strip() else "not a number"
        return LogError(
            problem, where=f"{path}, row {row}, column {column}", found=repr(text), advice="is it truncated?"
        )
    uneven = re.search(r"row (\d+)", message)
    row = f", row {int(uneven.group(1)) + 1}" if uneven else ""
    return LogError("rows of different length", where=f"{path}{row}", advice="is the log truncated?")


def _no_doubles(path: Path, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise LogError("two columns of one name", where=str(path), found=repr(name))


def _time(
    path: Path, names: list[str], units: list[str], table: NDArray[np.float64], wanted: str
) -> NDArray[np.float64]:
    if wanted not in names:
        raise LogError(
            "no time column",
            where=str(path),
            found=f"no column named {wanted}",
            known=names,
            advice='name it under [log] as time = "…"',
        )
    index = names.index(wanted)
    try:
        time = table[:, index] * convert(1.0, units[index] or "s", "s")
    except UnitError as error:
        raise LogError(str(error), where=f"{path}, column {wanted}") from error
    _row_error(path, wanted, ~np.isfinite(time), "time is not a number")
    backwards = np.append(False, np.diff(time) <= 0)
    _row_error(path, wanted, backwards, "time does not increase")
    return time


def _row_error(path: Path, column: str, bad: NDArray[np.bool_], problem: str) -> None:
    if bad.any():
        row = int(np.argmax(bad)) + 2
        more = f" ({int(bad.sum())} such rows)" if bad.sum() > 1 else ""
        raise LogError(
            problem, where=f"{path}, row {row}, column {column}{more}", advice="mend or cut the log there"
        )


def _converted(
    path: Path, name: str, values: NDArray[np.float64], unit: str, wanted: str | None
) -> tuple[NDArray[np.float64], str]:
    if wanted is None or unit in ("", wanted):
        return values, unit or (wanted or "")
    try:
        return values * convert(1.0, unit, wanted), wanted
    except UnitError as error:
        raise LogError(str(error), where=f"{path}, column {name}") from error


def _check_finite(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    for name, values in columns.items():
        _row_error(path, name, ~np.isfinite(values), "not a finite number")


def write_log(record: Record, path: str | Path) -> None:
    """Write a record as CSV that `read_log` reads back; the file appears whole or not at all."""
    path = Path(path)
    heads = [f"{name}[{record.units[name]}]" if record.units.get(name) else name for name in record.names]
    table = np.column_stack([record.time, *(record[name] for name in record.names)])
    part = path.with_name(path.name + ".part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(",".join(["time[s]", *heads]) + "\n")
            np.savetxt(file, table, delimiter=",", fmt="%.12g")
        part.replace(path)
    except OSError as error:
        raise LogError(f"cannot be written: {error.strerror}", where=str(path)) from error
