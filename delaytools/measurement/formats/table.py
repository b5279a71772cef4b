"""What a format finds in a file: names, units and columns as they stand there, before anything is checked."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Table", "table_of"]


def _from_one(index: int) -> int:
    return index + 1


@final
@dataclass(frozen=True)
class Table:
    """Columns that share one time, by name, each with its unit as the file writes it ("" = it says none).

    columns: arrays of any type and shape; what is no column of numbers is left out later, and said.
    clock: the time column's name, where the format itself knows it. place: the group inside the file.
    head: where the file holds the names, in words of a message. row_of: index from 0 -> row as messages count it.
    further: the file's other tables (groups with a time of their own, nested groups).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[NDArray[Any], ...]
    clock: str = ""
    place: str = ""
    head: str = ""
    row_of: Callable[[int], int] = _from_one
    further: tuple["Table", ...] = ()


def table_of(tree: Mapping[str, Any], units: Mapping[str, Any] | None = None, place: str = "") -> Table:
    """The table of a mapping name -> array; mappings and structured arrays inside become further tables.

    A mapping named `units` (or `unit`) gives the units of its neighbours by name.
    """
    units, columns, further = dict(units or {}), {}, []
    for name, item in tree.items():
        if name in ("units", "unit") and isinstance(item, Mapping):
            units |= item
    for name, item in tree.items():
        below = f"{place}/{name}" if place else name
        if isinstance(item, Mapping):
            if name not in ("units", "unit"):
                further.append(table_of(item, place=below))
            continue
        array = _array(item)
        if array.dtype.names:
            further.append(table_of({field: array[field] for field in array.dtype.names}, place=below))
        else:
            columns[name] = array
    own = Table(
        tuple(columns),
        tuple(_word(units.get(name, "")) for name in columns),
        tuple(columns.values()),
        place=place,
    )
    return replace(own, further=_flat(further))


def _word(unit: Any) -> str:
    return unit.strip("\0 ") if isinstance(unit, str) else ""  # MATLAB has an empty unit as an empty array


def _array(item: Any) -> NDArray[Any]:
    try:
        return np.asarray(item)
    except ValueError:  # rows of differing length
        return np.empty(0, dtype=object)


def _flat(tables: list[Table]) -> tuple[Table, ...]:
    return tuple(one for table in tables for one in (replace(table, further=()), *table.further))
