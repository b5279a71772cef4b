"""The door for logs: a file of any known format, or several, as Records, and back as CSV."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from delaytools.measurement.formats.registry import BINARY, read_table
from delaytools.measurement.log_columns import Columns, log_record
from delaytools.signals.record import Record
from delaytools.signals.trouble import LogError

__all__ = ["Columns", "read_log", "read_logs", "write_log"]


def read_log(path: str | Path, mapping: Columns | None = None) -> Record:
    """The record in a log (CSV, gzipped CSV, NPZ, MAT, HDF5, Parquet, MDF), in the units that the mapping wants.

    Whole numbers and truth values become floats, a table of k columns NAME[0] … NAME[k-1]. Text, complex numbers
    and arrays of another length are left out unless the mapping needs them; `source` says what was left out or
    interpolated, after the path. Raises LogError that names file, row and column: a file that is not there, empty
    or truncated, a column that is missing or no numbers, NaN, time that does not increase, a unit of the wrong
    dimension. In CSV, row 1 is the header; elsewhere it is the first row of numbers.
    """
    return log_record(str(path), read_table(Path(path)), mapping or Columns())


def read_logs(paths: Sequence[str | Path], mapping: Columns | None = None) -> tuple[Record, ...]:
    """The records of several logs of one bench, in the order of `paths`.

    The signals that the mapping wants (all, where it wants none) must stand in every log, in one unit.
    Raises LogError that names file and column where they do not, and as `read_log` does.
    """
    if not paths:
        raise LogError("no log given", advice="give one path or more")
    mapping = mapping or Columns()
    records = tuple(read_log(path, mapping) for path in paths)
    wanted = set(mapping.units) | set(mapping.columns.values())
    every = dict.fromkeys(name for record in records for name in record.names)
    for name in (name for name in every if name in wanted or not wanted):
        holder = next(k for k, record in enumerate(records) if name in record)
        for path, record in zip(paths, records, strict=True):
            _check_same(name, (str(paths[holder]), records[holder]), (str(path), record))
    return records


def _check_same(name: str, one: tuple[str, Record], other: tuple[str, Record]) -> None:
    (path, record), (second, found) = one, other
    if name not in found:
        raise LogError(
            "a signal that another log has is missing",
            where=f"{second}, column {name}",
            found=f"it stands in {path}",
            known=found.names,
            advice="leave that log out, or map the column under [log] columns",
        )
    if record.units.get(name, "") != found.units.get(name, ""):
        units = [unit.get(name) or "no unit" for unit in (found.units, record.units)]
        raise LogError(
            "logs of one bench in different units",
            where=f"{second}, column {name}",
            found=f"{units[0]}, against {units[1]} in {path}",
            advice="name the signal's unit under [signals] of the design",
        )


def write_log(record: Record, path: str | Path) -> None:
    """Write a record as CSV that `read_log` reads back; the file appears whole or not at all.

    Raises LogError for a path that cannot be written, or whose suffix is that of another format.
    """
    path = Path(path)
    if path.suffix.lower() in (*BINARY, ".gz"):
        raise LogError("logs are written as CSV", where=str(path), found=path.suffix, advice="name it .csv")
    table = np.column_stack([record.time, *(record[name] for name in record.names)])
    part = path.with_name(path.name + ".part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(",".join(["time[s]", *(_head(record, name) for name in record.names)]) + "\n")
            np.savetxt(file, table, delimiter=",", fmt="%.12g")
        part.replace(path)
    except OSError as error:
        raise LogError(f"cannot be written: {error.strerror}", where=str(path)) from error
    finally:
        if part.is_file():
            part.unlink()


def _head(record: Record, name: str) -> str:
    unit = record.units.get(name, "")
    return f"{name}[{unit}]" if unit or name.endswith("]") else name
