"""What drives a run: the design's [inputs], or a log's columns."""

from dataclasses import dataclass
from typing import Any, final

from delaytools.signals.trouble import DelaytoolsError

__all__ = ["Drive", "drive"]


@final
@dataclass(frozen=True)
class Drive:
    """Stimuli by external input, how long the run lasts (s), and what should be said."""

    stimuli: dict[str, Any]
    duration: float
    seed: int
    substeps: int | None
    notes: tuple[str, ...]


def drive(design: Any, loop: Any, log: Any, duration: float | None, seed: int | None) -> Drive:
    """The stimuli of a run: a log's columns first, then [inputs]; the rest is 0, and said."""
    from delaytools.design.stimuli import design_stimuli
    from delaytools.design.values import number
    from delaytools.measurement.log_notes import log_notes
    from delaytools.signals.stimulus import Column

    table = design.tables.simulation
    chosen = table.seed if seed is None else seed
    if chosen < 0:
        raise DelaytoolsError("a seed is 0 or more", where="--seed", found=f"{chosen}")
    stimuli = dict(design_stimuli(design, loop, seed=chosen))
    notes: list[str] = []
    if log is not None:
        notes.extend(log_notes(log))
        for name in loop.externals:
            if name in log:
                stimuli[name] = Column(time=log.time - log.time[0], values=log[name])
    for name in loop.externals:
        if name not in stimuli and name not in loop.random:
            notes.append(f"nothing drives the input {name}: it is 0")
    length = duration
    if length is None:
        length = float(log.time[-1] - log.time[0]) if log is not None else number(table.duration, "s")
    if not length > 0:
        raise DelaytoolsError("a run must last longer than 0 s", found=f"{length:g} s")
    return Drive(stimuli, length, chosen, table.substeps, tuple(notes))
