"""MATLAB files up to version 7: variables, or structs of them; a struct `units` gives the units by name."""

from pathlib import Path

from scipy.io import loadmat

from delaytools.measurement.formats.table import Table, table_of

__all__ = ["read"]


def read(path: Path) -> Table:
    """The variables of a MAT file (v4 to v7; v7.3 is HDF5), those inside structs as further tables."""
    variables = loadmat(path, simplify_cells=True)
    return table_of({name: item for name, item in variables.items() if not name.startswith("__")})
