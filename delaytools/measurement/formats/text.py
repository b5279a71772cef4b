"""CSV (also gzipped): a header row of `name` or `name[unit]`, then rows of numbers."""

import gzip
import re
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from delaytools.measurement.formats.table import Table
from delaytools.signals.trouble import LogError, shown

__all__ = ["head_of", "read"]

_HEAD = re.compile(r"^\s*(.*?)\s*(?:\[([^\[\]]*)\])?\s*$")
_ADVICE = "give a CSV file, or name the file by its format (.npz, .mat, .h5, .parquet, .mf4)"


def head_of(text: str) -> tuple[str, str]:
    """(name, unit) of a column's head, such as "rate[deg/s]"."""
    found = _HEAD.match(text)
    return (found.group(1), found.group(2) or "") if found else (text, "")


def read(path: Path) -> Table:
    """The columns of a CSV file; those whose first cell is a word are text.

    Raises LogError that names row and column: an empty or binary file, a cell that is no number, a row of another
    length than the header. Row 1 is the header.
    """
    names: list[str] = []
    try:
        with _opened(path) as file:
            names = _header(path, file.readline())
            words = _word_columns(file, len(names))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # an empty table, said later
                table = np.loadtxt(file, delimiter=",", ndmin=2, comments=None, converters=words or None)
    except UnicodeDecodeError as error:
        raise LogError("not a text file", where=str(path), advice=_ADVICE) from error
    except ValueError as error:
        raise _unreadable(path, names, str(error)) from error
    if not len(table):
        table = np.empty((0, len(names)))
    if table.shape[1] != len(names):
        found = f"{table.shape[1]} values, {len(names)} names"
        raise LogError("rows and header differ in length", where=f"{path}, row 2", found=found)
    heads = [head_of(name) for name in names]
    text = np.broadcast_to(np.array("a word"), len(table))
    columns: list[NDArray] = [text if k in words else table[:, k] for k in range(len(names))]
    row_of = partial(_line_of, path)
    plain, units = tuple(name for name, _ in heads), tuple(unit for _, unit in heads)
    return Table(plain, units, tuple(columns), head="row 1", row_of=row_of)


def _opened(path: Path) -> TextIO:
    with path.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
    return gzip.open(path, "rt", encoding="utf-8-sig") if packed else path.open(encoding="utf-8-sig")


def _word_columns(file: TextIO, count: int) -> dict[int | str, Callable[[str], Any]]:
    """The columns whose cell in the first row is a word, each with a converter that reads it as no number."""
    place, line = file.tell(), "\n"
    while line and not line.strip():
        line = file.readline()
    file.seek(place)
    cells = line.strip().split(",")
    if len(cells) != count:
        return {}
    return {k: _no_number for k, cell in enumerate(cells) if cell.strip() and not _is_number(cell)}


def _no_number(cell: str) -> float:
    return float("nan")


def _header(path: Path, line: str) -> list[str]:
    where = f"{path}, row 1"
    if "\0" in line:
        raise LogError("not a text file", where=str(path), advice=_ADVICE)
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
    return LogError("not a table of numbers", where=str(path), found=shown(message), advice=_ADVICE)


def _line_of(path: Path, index: int) -> int:
    """The line of the file, counted from 1, that holds the row of numbers `index`, counted from 0."""
    with _opened(path) as file:
        filled = (number for number, line in enumerate(file, 1) if number > 1 and line.strip())
        return next((number for k, number in enumerate(filled) if k == index), index + 2)
