"""MDF (version 4, and 3): channels by name, one table per channel group, whose time is the group's master."""

import gc
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF
from numpy.typing import NDArray

from delaytools.measurement.formats.table import Table
from delaytools.signals.trouble import LogError, shown

__all__ = ["read"]


def read(path: Path) -> Table:
    """The channels of an MDF file; samples marked invalid are NaN.

    Raises LogError for a file that is damaged, or holds fewer samples than it says.
    """
    file = _opened(path)
    try:
        tables = [_group(path, file, index) for index in range(len(file.groups))]
    finally:
        file.close()
    tables = [table for table in tables if table.columns and len(table.columns[0])]
    if not tables:
        raise LogError("no rows", where=str(path), advice="is the log truncated?")
    return replace(tables[0], further=tuple(tables[1:]))


def _opened(path: Path) -> MDF:
    """The open file. A half-opened one complains while it is thrown away: that is kept off the screen."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        return MDF(path)
    except Exception as error:
        problem = shown(str(error))
        error.__traceback__ = None
        gc.collect()  # it is held by a cycle: thrown away here, not later
    finally:
        sys.unraisablehook = hook
    raise LogError("damaged or truncated", where=str(path), found=problem, advice="record or copy it again")


def _group(path: Path, file: Any, index: int) -> Table:
    group = file.groups[index]
    time = file.get_master(index)
    promised = group.channel_group.cycles_nr
    if len(time) != promised:
        found = f"{len(time)} of {promised} samples in channel group {index}"
        raise LogError("damaged or truncated", where=str(path), found=found, advice="record or copy it again")
    master = file.masters_db.get(index)
    signals = [
        file.get(group=index, index=k, ignore_invalidation_bits=True)
        for k in range(len(group.channels))
        if k != master
    ]
    clock = () if master is None else (group.channels[master].name,)
    return Table(
        (*clock, *(signal.name for signal in signals)),
        (*("s" for _ in clock), *(signal.unit or "" for signal in signals)),
        (*(time for _ in clock), *(_values(signal) for signal in signals)),
        clock="".join(clock),
        place=f"group {index}",
    )


def _values(signal: Any) -> NDArray[Any]:
    bad = signal.invalidation_bits
    if bad is None or not np.any(bad) or signal.samples.dtype.kind not in "biuf":
        return signal.samples
    return np.where(np.asarray(bad, dtype=bool), np.nan, signal.samples)
