"""The door for logs: a CSV file with a header of `name` or `name[unit]`, as a Record, and back."""

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.signals.record import Record
from delaytools.signals.trouble import LogError, UnitError, shown
from delaytools.signals.units import convert

__all__ = ["Columns", "read_log", "write_log"]

_HEADER = re.compile(r"^\s*(.*?)\s*(?:\[(.*?)\])?\s*$")


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


def read_log(path: str | Path, mapping: Columns | None = None) -> Record:
    """The record in a CSV file, in the units that the mapping wants.

    Raises LogError that names file, row and column: a file that is not there, empty or truncated, a column that is
    missing, NaN, time that does not increase, a unit of the wrong dimension. Row 1 is the header.
    """
    path, mapping = Path(path), mapping or Columns()
    names, table = _table(path)
    heads = [_HEADER.match(name) for name in names]
    plain = [head.group(1) if head else name for head, name in zip(heads, names, strict=True)]
    units = [(head.group(2) or "") if head else "" for head in heads]
    _check_columns(path, plain, mapping)
    clock = mapping.time if mapping.time in plain or "time" not in plain else "time"
    time = _time(path, plain, units, table, clock)
    columns, found = {}, {}
    for index, (name, unit) in enumerate(zip(plain, units, strict=True)):
        if name == clock:
            continue
        signal = mapping.columns.get(name, name)
        _row_error(path, name, ~np.isfinite(table[:, index]), "not a finite number")
        columns[signal], found[signal] = _converted(
            path, name, table[:, index], unit, mapping.units.get(signal)
        )
    return Record(time, columns, found, mapping.held & frozenset(columns), str(path))


def _table(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    names: list[str] = []
    try:
        with path.open(encoding="utf-8-sig") as file:
            names = _header(path, file.readline())
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # an empty table, said below
                table = np.loadtxt(file, delimiter=",", ndmin=2, comments=None)
    except FileNotFoundError as error:
        here = sorted(p.name for p in path.parent.glob("*.csv")) if path.parent.is_dir() else []
        raise LogError("no such file", where=str(path), found=path.name, known=here) from error
    except UnicodeDecodeError as error:
        raise LogError("not a text file", where=str(path), advice="give a CSV file") from error
    except OSError as error:
        raise LogError(f"cannot be read: {error.strerror}", where=str(path)) from error
    except ValueError as error:
        raise _unreadable(path, names, str(error)) from error
    if len(table) < 2:
        problem = (
            "a header but no rows" if table.size == 0 else "a log has two rows or more, this one has one"
        )
        raise LogError(problem, where=str(path), advice="is the log truncated?")
    if table.shape[1] != len(names):
        raise LogError(
            "rows and header differ in length",
            where=f"{path}, row 2",
            found=f"{table.shape[1]} values, {len(names)} names",
        )
    return names, table


def _header(path: Path, line: str) -> list[str]:
    where = f"{path}, row 1"
    if "\0" in line:
        raise LogError("not a text file", where=str(path), advice="give a CSV file")
    if not line.strip():
        problem = "the file is empty" if not line else "the header row is empty"
        raise LogError(
            problem, where=str(path), advice="a log begins with a header row: time[s],NAME[UNIT],…"
        )
    names = [name.strip().strip('"').strip() for name in line.strip().split(",")]
    other = next((mark for mark in (";", "\t") if mark in line), "")
    if len(names) == 1 and other:
        word = "semicolons" if other == ";" else "tabs"
        raise LogError("one column only", where=where, found=word, advice="separate columns by commas")
    if all(_is_number(name) for name in names):
        raise LogError("numbers where the header row should be", where=where, advice="name the columns")
    return names


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _unreadable(path: Path, names: list[str], message: str) -> LogError:
    place = re.search(r"string '(.*)' to float64 at row (\d+), column (\d+)", message, re.DOTALL)
    if place:
        text, number = place.group(1), int(place.group(3))
        row = _line_of(path, int(place.group(2)))
        problem = "an empty cell" if not text.strip() else "not a number"
        column = f"{number} ({names[number - 1]})" if number <= len(names) else f"{number}"
        return LogError(
            problem,
            where=f"{path}, row {row}, column {column}",
            found=shown(text),
            advice="is the log truncated?" if not text.strip() else "mend the cell, or cut the log there",
        )
    uneven = re.search(r"from (\d+) to (\d+) at row (\d+)", message)
    if uneven:
        wanted, found, row = (int(part) for part in uneven.groups())
        row = _line_of(path, row - 1)
        return LogError(
            "a row of another length",
            where=f"{path}, row {row}",
            found=f"{found} values instead of {wanted}",
            advice="is the log truncated?",
        )
    return LogError("not a table of numbers", where=str(path), found=shown(message), advice="give a CSV file")


def _line_of(path: Path, index: int) -> int:
    """The line of the file, counted from 1, that holds the row of numbers `index`, counted from 0."""
    with path.open(encoding="utf-8-sig") as file:
        filled = (number for number, line in enumerate(file, 1) if number > 1 and line.strip())
        return next((number for k, number in enumerate(filled) if k == index), index + 2)


def _check_columns(path: Path, names: list[str], mapping: Columns) -> None:
    for name in names:
        if names.count(name) > 1:
            numbers = ", ".join(str(k + 1) for k, other in enumerate(names) if other == name)
            found = f"{name!r} in columns {numbers}"
            raise LogError(
                "two columns of one name", where=f"{path}, row 1", found=found, advice="rename one"
            )
    for column, signal in mapping.columns.items():
        if column not in names and signal not in names:
            raise LogError(
                "missing column",
                where=str(path),
                found=f"no column {column}, nor {signal}",
                known=names,
                advice="it is named under [log] of the design",
            )
        if column in names and signal in names and column != signal and signal not in mapping.columns:
            raise LogError(
                "two columns for one signal",
                where=f"{path}, row 1",
                found=f"{column} and {signal}, both {signal}",
                advice="name one of them under [log] columns for another signal",
            )


def _time(
    path: Path, names: list[str], units: list[str], table: NDArray[np.float64], wanted: str
) -> NDArray[np.float64]:
    if wanted not in names:
        raise LogError(
            "no time column",
            where=f"{path}, row 1",
            found=f"no column named {wanted}",
            known=names,
            advice='name it under [log] as time = "…"',
        )
    index = names.index(wanted)
    time, _ = _converted(path, wanted, table[:, index], units[index] or "s", "s")
    _row_error(path, wanted, ~np.isfinite(time), "time is not a finite number")
    _row_error(path, wanted, np.append(False, np.diff(time) <= 0), "time does not increase")
    return time


def _row_error(path: Path, column: str, bad: NDArray[np.bool_], problem: str) -> None:
    if bad.any():
        row = _line_of(path, int(np.argmax(bad)))
        more = f"in {int(bad.sum())} rows, first in this one" if bad.sum() > 1 else ""
        where = f"{path}, row {row}, column {column}"
        raise LogError(problem, where=where, found=more, advice="mend or cut the log there")


def _converted(
    path: Path, name: str, values: NDArray[np.float64], unit: str, wanted: str | None
) -> tuple[NDArray[np.float64], str]:
    if wanted is None or unit in ("", wanted):
        return values, unit or (wanted or "")
    try:
        return values * convert(1.0, unit, wanted), wanted
    except UnitError as error:
        found = error.found if error.known else repr(unit)
        advice = error.advice if error.known else f"the design has it in {wanted or 'no unit'}"
        raise LogError(
            f"{error.problem} of a column" if not error.known else error.problem,
            where=f"{path}, row 1, column {name}",
            found=found,
            known=error.known,
            advice=advice,
        ) from error


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
    finally:
        if part.is_file():
            part.unlink()
