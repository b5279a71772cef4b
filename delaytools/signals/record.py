"""A record of signals over time: the same thing whether measured or simulated."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.signals.trouble import DelaytoolsError

__all__ = ["Record"]


@final
@dataclass(frozen=True)
class Record:
    """Signals by name, each an array of the shape of `time`.

    time: (n,) s, strictly increasing. columns: name -> (n,) in the unit that `units` gives for it.
    A row is the bench at that instant: continuous signals as they are, sampled outputs as just computed.
    held: names of the signals that keep their value until the next row (written by sampled blocks).
    """

    time: NDArray[np.float64]
    columns: Mapping[str, NDArray[np.float64]]
    units: Mapping[str, str] = field(default_factory=dict)
    held: frozenset[str] = frozenset()
    source: str = ""

    def __post_init__(self) -> None:
        time = _frozen(self.time)
        columns = {name: _frozen(values) for name, values in self.columns.items()}
        for name, values in columns.items():
            if values.shape != time.shape:
                raise DelaytoolsError(
                    "a column must have one value per row",
                    where=name,
                    found=f"{values.shape} against {time.shape}",
                )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "units", MappingProxyType(dict(self.units)))

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        if name not in self.columns:
            raise DelaytoolsError("no such signal in the record", found=repr(name), known=self.columns)
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.time)

    @property
    def names(self) -> tuple[str, ...]:
        """The signals' names, in their order."""
        return tuple(self.columns)

    def between(self, start: float, end: float) -> "Record":
        """The rows with start <= time <= end (s)."""
        rows = (self.time >= start) & (self.time <= end)
        return self.rows(rows)

    def rows(self, which: NDArray[np.bool_] | slice) -> "Record":
        """The chosen rows of every signal."""
        columns = {name: values[which] for name, values in self.columns.items()}
        return Record(self.time[which], columns, self.units, self.held, self.source)

    def only(self, names: Iterable[str]) -> "Record":
        """The named signals alone."""
        wanted = tuple(names)
        columns = {name: self[name] for name in wanted}
        units = {name: self.units[name] for name in wanted if name in self.units}
        return Record(self.time, columns, units, self.held & frozenset(wanted), self.source)

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return Record, (self.time, dict(self.columns), dict(self.units), self.held, self.source)


def _frozen(values: NDArray[np.float64]) -> NDArray[np.float64]:
    array = np.array(values, dtype=float, copy=True)
    array.flags.writeable = False
    return array
