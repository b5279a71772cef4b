"""The whole loop run from a log's external inputs alone, against what was measured."""

from collections.abc import Sequence

import numpy as np

from delaytools.loop.loop import Loop
from delaytools.measurement.comparison import ClosedLoop
from delaytools.measurement.measures import fit_percent, rms
from delaytools.signals.record import Record
from delaytools.signals.trouble import DelaytoolsError
from delaytools.simulation.replay import Replay, driven_by

__all__ = ["closed_loop_runs"]

FAR = 1e100
RUNAWAY = 10.0  # times the measured peak: the run has left the bench


def closed_loop_runs(loop: Loop, records: Sequence[Record]) -> tuple[ClosedLoop, ...]:
    """One for each log; figures are empty where the run says nothing, and `why` says why."""
    return tuple(_run(loop, record) for record in records)


def _run(loop: Loop, record: Record) -> ClosedLoop:
    name = record.source.partition("; ")[0]
    absent = [n for n in loop.externals if n not in record and n not in loop.random]
    if absent:
        return ClosedLoop(name, {}, f"the log has no column for the external input {', '.join(absent)}")
    if not any(np.ptp(record[n]) > 0 for n in loop.externals if n in record):
        return ClosedLoop(name, {}, "nothing that is measured drives the loop from outside")
    signals = tuple(n for n in record.names if n in loop.writers and "@" not in n)
    stimuli = driven_by(record, loop.externals)
    try:
        rows = Replay(loop, stimuli, record.time - record.time[0], signals).run()
    except DelaytoolsError as error:
        return ClosedLoop(name, {}, str(error))
    if not (np.isfinite(rows).all() and np.abs(rows).max(initial=0.0) < FAR):
        return ClosedLoop(name, {}, "the loop of the model diverges")
    away = [
        n for j, n in enumerate(signals)
        if np.abs(rows[:, j]).max() > RUNAWAY * max(float(np.abs(record[n]).max()), 1e-300) and np.ptp(record[n]) > 0
    ]  # fmt: skip
    figures = {
        n: (rms(record[n] - rows[:, j]), fit_percent(record[n], rows[:, j])) for j, n in enumerate(signals)
    }
    why = f"the loop of the model runs away at {away[0]}: errors grow with time" if away else ""
    return ClosedLoop(name, figures, why)
