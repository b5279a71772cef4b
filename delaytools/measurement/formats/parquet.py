"""Parquet: columns by name; a field's metadata `unit` (or `units`) is its unit."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from delaytools.measurement.formats.table import Table
from delaytools.measurement.formats.text import head_of

__all__ = ["read"]


def read(path: Path) -> Table:
    """The columns of a Parquet file; a null is NaN; a head `name[unit]` is read as in CSV where no unit is said."""
    table = pq.read_table(path)
    heads = [head_of(name) for name in table.column_names]
    return Table(
        tuple(name for name, _ in heads),
        tuple(_unit(field) or unit for field, (_, unit) in zip(table.schema, heads, strict=True)),
        tuple(_values(column) for column in table.columns),
    )


def _unit(field: pa.Field) -> str:
    metadata = field.metadata or {}
    return (metadata.get(b"unit") or metadata.get(b"units") or b"").decode()


def _values(column: pa.ChunkedArray) -> NDArray[Any]:
    kind = column.type
    if pa.types.is_boolean(kind):
        column, kind = column.cast(pa.int8()), pa.int8()
    if pa.types.is_decimal(kind) or (pa.types.is_integer(kind) and column.null_count):
        column = column.cast(pa.float64(), safe=False)
    if pa.types.is_nested(kind):
        return np.empty(0, dtype=object)
    return np.asarray(column.to_numpy())
