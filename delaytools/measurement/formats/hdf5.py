"""HDF5 and MATLAB v7.3: datasets by name, units as the attribute `units` or `unit` (or MATLAB's struct `units`)."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from delaytools.measurement.formats.table import Table, table_of

__all__ = ["read"]


def read(path: Path) -> Table:
    """The datasets of an HDF5 file, those inside groups as further tables."""
    with h5py.File(path, "r") as file:
        return table_of(_tree(file))


def _tree(group: h5py.Group) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    units: dict[str, str] = {}
    for name, item in group.items():
        if isinstance(item, h5py.Group):
            if not name.startswith("#"):  # MATLAB's own store of references
                tree[name] = _tree(item)
        elif isinstance(item, h5py.Dataset):
            tree[name] = _values(item)
            units |= {name: _unit(item)} if _unit(item) else {}
    written = tree.get("units")
    if units and (written is None or isinstance(written, dict)):
        tree["units"] = (written or {}) | units
    return tree


def _values(dataset: h5py.Dataset) -> Any:
    values = dataset[()]
    if dataset.attrs.get("MATLAB_class") in (b"char", "char"):
        return "".join(chr(code) for code in np.ravel(values))
    return np.empty(0) if isinstance(values, h5py.Empty) else values


def _unit(dataset: h5py.Dataset) -> str:
    for key in ("units", "unit"):
        if key in dataset.attrs:
            text = np.ravel(dataset.attrs[key])[:1]
            return "".join(part.decode() if isinstance(part, bytes) else str(part) for part in text)
    return ""
