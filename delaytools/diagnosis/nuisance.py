"""What uncertain values of other segments do at the exits of a segment, as a hypothesis passes it on."""

from dataclasses import replace

import numpy as np

from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.signals.record import Record

__all__ = ["with_nuisance_of"]


def with_nuisance_of(case: Case, fitted: Fitted) -> Case:
    """The case with the exits' response to each uncertain value of the segments that write its entries.

    By this hypothesis: with values of the design, 3 % off, a lightly damped airframe answers out of step. A value whose
    change makes a run end nowhere counts as known.
    """
    if not any(directions.size for moved in case.uncertain for directions in moved.values()):
        return case
    found = []
    for replay, record, moved in zip(case.replays(fitted.added), case.records, case.uncertain, strict=True):
        base = replay.run(fitted.values)
        changes = []
        for entry, directions in moved.items():
            names = tuple(n for n in case.segment.loop.externals if n.removesuffix("@read") == entry)
            for rows in directions.T:
                columns = {**record.columns, entry: record[entry] + rows}
                shifted = case.stimuli_for(Record(record.time, columns, record.units, record.held), names)
                change = replay.run_driven(fitted.values, shifted) - base
                changes.append(change if np.isfinite(change).all() else np.zeros_like(base))
        found.append(np.stack(changes, axis=2))
    return replace(case, nuisance=tuple(found))
