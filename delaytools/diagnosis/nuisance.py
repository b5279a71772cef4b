"""What is uncertain of the columns that drive a segment, and what a hypothesis makes of that at the exits."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import SEEN
from delaytools.diagnosis.case import SURE, Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.noise_of import column_noise
from delaytools.signals.record import Record

__all__ = ["with_nuisance_of"]

Array = NDArray[np.float64]
STRETCHES = 32  # of a log in which the mean of the noise in a motion is uncertain


def with_nuisance_of(case: Case, fitted: Fitted) -> Case:
    """The case with the exits' response to each uncertain value of the segments that write its entries, and to the
    noise of the measured motion along which an effect of the hypothesis acts.

    By this hypothesis: with values of the design, 3 % off, a lightly damped airframe answers out of step. A value whose
    change makes a run end nowhere counts as known.
    """
    directions = [list(_directions(case, fitted, log)) for log in range(len(case.records))]
    if not any(rows.any() for group in directions for _, _, rows in group):
        return replace(case, nuisance=()) if case.nuisance else case
    found = []
    for replay, record, group in zip(case.replays(fitted.added), case.records, directions, strict=True):
        base = replay.run(fitted.values)
        changes = []
        for column, names, rows in group:
            if not rows.any():
                changes.append(np.zeros_like(base))
                continue
            columns = {**record.columns, column: record[column] + rows}
            shifted = case.stimuli_for(Record(record.time, columns, record.units, record.held), names)
            change = replay.run_driven(fitted.values, shifted) - base
            changes.append(change if np.isfinite(change).all() else np.zeros_like(base))
        found.append(np.stack(changes, axis=2))
    return replace(case, nuisance=tuple(found))


def _directions(case: Case, fitted: Fitted, log: int) -> Iterator[tuple[str, tuple[str, ...], Array]]:
    """Column of a log, the external signals that it drives, and what one standard error does to it (n,)."""
    for entry, directions in (case.uncertain[log] if case.uncertain else {}).items():
        names = tuple(n for n in case.segment.loop.externals if n.removesuffix("@read") == entry)
        for rows in directions.T:
            yield entry, names, rows
    for exit in sorted({exit for one in fitted.added for exit in one.along.values()}):
        for other, record in enumerate(case.records):
            for rows in _means(record, exit):
                yield exit, (f"{exit}{SEEN}",), rows if other == log else np.zeros(len(case.records[log]))


def _means(record: Record, name: str) -> Iterator[Array]:
    """(n,) a standard error of the mean of a column's noise, stretch by stretch: an integrating segment adds it up."""
    noise = column_noise(record[name], name in record.held)
    for part in np.array_split(np.arange(len(record)), STRETCHES):
        rows = np.zeros(len(record))
        rows[part] = noise / np.sqrt(max(len(part), 1)) / SURE
        yield rows
