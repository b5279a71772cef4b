"""What is uncertain of the columns that drive a segment, and what a hypothesis makes of that at the exits."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import SEEN
from delaytools.diagnosis.case import SURE, Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.noise_of import column_noise
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Stimulus, jumping
from delaytools.simulation.replay import Replay

__all__ = ["with_nuisance_of"]

Array = NDArray[np.float64]
FEW_JUMPS = 8  # of an entry: each may be anywhere between its rows
STRETCHES = 32  # of a log in which the mean of the noise in a motion is uncertain


def with_nuisance_of(case: Case, fitted: Fitted) -> Case:
    """The case with the exits' response to each uncertain value of the segments that write its entries, and to the
    noise of the measured motion along which an effect of the hypothesis acts.

    By this hypothesis: with values of the design, 3 % off, a lightly damped airframe answers out of step. A value whose
    change makes a run end nowhere counts as known.
    """
    directions = [list(_directions(case, fitted, log)) for log in range(len(case.records))]
    jumps = [list(_within_jumps(case, log)) for log in range(len(case.records))]
    if not any(rows.any() for group in directions for _, _, rows in group) and not any(jumps):
        return replace(case, nuisance=()) if case.nuisance else case
    found = []
    for log, (replay, record) in enumerate(zip(case.replays(fitted.added), case.records, strict=True)):
        base = replay.run(fitted.values)
        changes = []
        for column, names, rows in directions[log]:
            if not rows.any():
                changes.append(np.zeros_like(base))
                continue
            columns = {**record.columns, column: record[column] + rows}
            shifted = case.stimuli_for(Record(record.time, columns, record.units, record.held), names)
            changes.append(_change(replay, fitted, shifted, base))
        for other, group in enumerate(jumps):
            changes += [_change(replay, fitted, one, base) if other == log else np.zeros_like(base) for one in group]
        found.append(np.stack(changes, axis=2))
    return replace(case, nuisance=tuple(found))


def _change(replay: Replay, fitted: Fitted, shifted: Mapping[str, Stimulus], base: Array) -> Array:
    """(n, exits) what other stimuli change; nothing where the run ends nowhere."""
    change = replay.run_driven(fitted.values, shifted) - base
    return change if np.isfinite(change).all() else np.zeros_like(base)


def _within_jumps(case: Case, log: int) -> Iterator[Mapping[str, Stimulus]]:
    """Stimuli for each jump of an entry between two rows: as if it were at an end of the row instead of half way.

    The rows themselves stay as they are: only what is added up in between differs. Not of what comes from outside, as a
    demand, whose rows are taken as they are, and none where an entry jumps often.
    """
    record = case.records[log]
    for entry in case.segment.entries:
        if entry not in record or entry in record.held | case.outside:
            continue
        time, rows = record.time - record.time[0], record[entry]
        places = np.flatnonzero(jumping(np.diff(rows) / np.diff(time)))
        names = tuple(n for n in case.segment.loop.externals if n.removesuffix("@read") == entry)
        stimuli = case.stimuli_for(record, names) if 0 < len(places) <= FEW_JUMPS else {}
        for k in places if stimuli else ():
            ends, jump = (float(time[k]), float(time[k + 1])), float(rows[k + 1] - rows[k])
            yield {name: _Within(original, *ends, 0.5 * jump / SURE) for name, original in stimuli.items()}


@final
@dataclass(frozen=True)
class _Within(Stimulus):
    """A stimulus that is larger between two rows, by so much in the mean, and the same at both."""

    original: Stimulus
    begin: float
    end: float
    mean: float

    @property
    def jumps(self) -> tuple[float, ...]:
        return self.original.jumps

    def value(self, t: Array) -> Array:
        part = np.clip((t - self.begin) / (self.end - self.begin), 0.0, 1.0)
        return np.asarray(self.original.value(t) + 6 * self.mean * part * (1 - part))


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
