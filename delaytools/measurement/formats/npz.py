"""NPZ: arrays by name (`name` or `name[unit]`), as numpy.savez writes them."""

from pathlib import Path

import numpy as np

from delaytools.measurement.formats.table import Table, table_of
from delaytools.measurement.formats.text import head_of

__all__ = ["read"]


def read(path: Path) -> Table:
    """The arrays of an NPZ file; pickled objects are never loaded."""
    columns, units = {}, {}
    with np.load(path, allow_pickle=False) as archive:
        for key in archive.files:
            name, unit = head_of(key)
            try:
                columns[name] = archive[key]
            except ValueError as error:
                if "allow_pickle" not in str(error):
                    raise
                columns[name] = np.empty(0, dtype=object)
            units[name] = unit
    return table_of(columns, units)
