"""What may be wrong with a log's columns, said by file, row and column."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from delaytools.measurement.formats.table import Table
from delaytools.measurement.rasters import usual_step
from delaytools.signals.record import Record
from delaytools.signals.trouble import LogError, UnitError
from delaytools.signals.units import convert

__all__ = ["Wishes", "check_names", "check_raster", "finite", "left_out_note", "rising", "unit_error"]

FACTOR = 5e3  # between rows and frame
LARGEST = 1e30  # fill values are larger; squares of what is smaller do not overflow


class Wishes(Protocol):
    """What of a mapping of columns the checks read."""

    @property
    def columns(self) -> Mapping[str, str]:
        """Column -> signal."""


def _place(*parts: str) -> str:
    return ", ".join(part for part in parts if part)


def check_names(path: str, tables: Sequence[Table], mapping: Wishes) -> None:
    """Raises LogError for a name that stands twice, a mapped column that is missing, two columns for one signal."""
    names = [name for table in tables for name in table.names]
    where = _place(path, tables[0].head)
    for name in names if len(set(names)) < len(names) else ():
        if names.count(name) > 1:
            numbers = ", ".join(str(k + 1) for k, other in enumerate(names) if other == name)
            found = f"{name!r} in columns {numbers}"
            raise LogError("two columns of one name", where=where, found=found, advice="rename one")
    for column, signal in mapping.columns.items():
        if column not in names and signal not in names:
            found, advice = f"no column {column}, nor {signal}", "it is named under [log] of the design"
            raise LogError("missing column", where=path, found=found, known=names, advice=advice)
        if column in names and signal in names and column != signal and signal not in mapping.columns:
            raise LogError(
                "two columns for one signal",
                where=where,
                found=f"{column} and {signal}, both {signal}",
                advice="name one of them under [log] columns for another signal",
            )


def finite(
    path: str, table: Table, column: str, values: NDArray[Any], *, problem: str = "not a finite number"
) -> None:
    """Raises LogError for NaN, infinities and what only fills a gap, at the first row that holds one."""
    if values.dtype.kind == "f":
        where = _place(path, "row {}", f"column {column}")
        _row_error(where, table, ~np.isfinite(values), problem)
        _row_error(where, table, np.abs(values) > LARGEST, "no number that a bench can show")


def rising(path: str, table: Table, column: str, time: NDArray[np.float64]) -> None:
    """Raises LogError where time stands or runs backwards."""
    bad = np.append(False, np.diff(time) <= 0)
    _row_error(_place(path, "row {}", f"column {column}"), table, bad, "time does not increase")


def _row_error(where: str, table: Table, bad: NDArray[np.bool_], problem: str) -> None:
    if bad.any():
        row = table.row_of(int(np.argmax(bad)))
        more = f"in {int(bad.sum())} rows, first in this one" if bad.sum() > 1 else ""
        where = where.replace("row {}", f"row {row}", 1)
        raise LogError(problem, where=where, found=more, advice="mend or cut the log there")


def unit_error(path: str, table: Table, column: str, unit: str, wanted: str) -> LogError:
    """The error of a column whose unit is unknown, or cannot be written in the unit wanted."""
    where = _place(path, table.head, f"column {column}")
    try:
        convert(1.0, unit, wanted)
    except UnitError as error:
        if error.known:
            return LogError(
                error.problem, where=where, found=error.found, known=error.known, advice=error.advice
            )
        problem = f"{error.problem} of a column"
    advice = f"the design has it in {wanted or 'no unit'}"
    return LogError(problem, where=where, found=repr(unit), advice=advice)


def left_out_note(lost: Mapping[str, str]) -> tuple[str, ...]:
    """A sentence on the columns that could not be kept, none where all were."""
    if not lost:
        return ()
    return ("left out: " + ", ".join(f"{name} ({reason})" for name, reason in lost.items()),)


def check_raster(record: Record, frame: float) -> None:
    """Raises LogError where rows are so much longer or shorter than a design's frame (s) that their unit is another."""
    usual = usual_step(record)
    if not frame / FACTOR < usual < FACTOR * frame:
        found = f"rows {usual:g} s apart, the design's frame is {frame:g} s"
        where, advice = record.source.split("; ")[0], "is its time in another unit? write time[ms] or the like"
        raise LogError("a log in another time than the design", where=where, found=found, advice=advice)
