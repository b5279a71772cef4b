"""Whether an effect is worth its values: on data not used for the fit, against the noise, against the rows."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import path_of
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis, has_odd_rows
from delaytools.diagnosis.heldout import held_out
from delaytools.diagnosis.noise import FEW_ODD, incoherent_spectrum, without_odd_rows
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.proposals import PENALTY
from delaytools.signals.record import Record

__all__ = ["MOST", "NAMED", "PART_OF_NOISE", "UNKNOWN", "WORTHLESS", "most_of", "objection"]

Array = NDArray[np.float64]
MOST, MOST_IN_PIECES = 3, 2  # effects of a segment; in real runs a third one takes what no catalogue holds
NAMED = 60.0  # held-out χ² that an effect must be worth
PART_OF_NOISE = 0.25  # of the noise rms that an effect must contribute
IN_A_BAND = 1.5  # times the noise density, where an effect is small in all
LUCK = 3.5  # standard errors over rows by which an effect must win (Vuong 1989): noise in spikes pays by chance
ROUNDING = 1e-9  # of a level at which residuals are cut
SHORTEST = 0.5  # rows: a shorter delay or lag may be the way in which rows are joined
BRIEF = "shorter than half a row, as the way may be in which rows are joined"
UNKNOWN = "the logs say nothing of its values"
WORTHLESS = "no better on data not used for the fit"
SMALL = "significant but smaller than a quarter of the noise"
OWN_NOISE = "its source holds the noise of the signal itself, and nothing else of it helps"


def most_of(case: Case) -> int:
    """Effects that one segment may be given."""
    return MOST_IN_PIECES if case.pieces else MOST


def objection(case: Case, before: Fitted, after: Fitted, carried: Carried, place: int = -1) -> str:
    """Why the effect at a place is not to be named; "" where it pays on held-out data, is not lost in the noise, and is
    longer than rows can tell. before: the hypothesis without it."""
    known = after.added[place].values
    if any(known.get(name, np.inf) < SHORTEST * case.step for name in ("delay", "time_constant")):
        return BRIEF
    if _is_unknown(after, place):
        return UNKNOWN
    before, after = _without_odd_rows(case, before, after)
    now, then = held_out(after, case.rows), held_out(before, case.rows)
    gain, _ = now.better_than(then)
    if gain < max(NAMED + PENALTY * (after.size - before.size - 1), LUCK * now.luck_beside(then)):
        return WORTHLESS
    if not _matters(case, before, after, carried, place):
        return SMALL
    return OWN_NOISE if _reads_own_noise(case, before, after, place) else ""


def _without_odd_rows(case: Case, before: Fitted, after: Fitted) -> tuple[Fitted, Fitted]:
    """Both without the few rows that are off by far more than noise in either, where such rows mean nothing.

    A row that a quantiser rounds the other way is right again by the least change of anything ahead of it.
    """
    if not has_odd_rows(case, after.added):
        return before, after
    cut = case.without_odd_rows(before.residual)
    odd = (cut != before.residual) | (np.abs(after.residual) >= case.cut_levels * (1 - ROUNDING))
    if odd.mean() >= FEW_ODD:
        return replace(before, residual=cut), after
    first, then = (replace(one, residual=np.where(odd, 0.0, one.residual)) for one in (before, after))
    return first, then


def _reads_own_noise(case: Case, before: Fitted, after: Fitted, place: int) -> bool:
    """Whether an effect pays by the noise of the exit itself, which its source carries.

    A computer's output holds, from the same instant on, the noise of what it reads: a coupling from it would take that
    noise off. Read an update late it cannot, and hardly knows less of anything else.
    """
    source = after.added[place].fixed.get("source")
    if source is None or source in case.outside or source in case.segment.entries:
        return False
    late = replace(case, records=tuple(_late(record, source) for record in case.records), _replays={})
    again = fit_hypothesis(late, after.added, near=after)
    gain, _ = held_out(again, case.rows).better_than(held_out(before, case.rows))
    return gain < NAMED


def _late(record: Record, name: str) -> Record:
    """The record with a column one update, or one row, late."""
    values = record[name]
    changes = np.flatnonzero(np.diff(values)) if name in record.held else np.zeros(0)
    rows = int(np.median(np.diff(changes))) if len(changes) > 2 else 1
    late = np.concatenate([np.full(rows, values[0]), values[: len(values) - rows]])
    return Record(record.time, {**record.columns, name: late}, record.units, record.held, record.source)


def _is_unknown(fitted: Fitted, place: int) -> bool:
    """Whether a reported value of an effect has an infinite standard error."""
    one, known = fitted.added[place], fitted.by_path
    paths = (path_of(place % len(fitted.added), name) for name in one.reported)
    return any(path in known and known[path].std == np.inf for path in paths)


def _matters(case: Case, before: Fitted, after: Fitted, carried: Carried, place: int = -1) -> bool:
    """Whether the effect at a place contributes more than a part of the noise, in all or in some band."""
    kept = case.outputs(after.added, after.values)
    lost = _taken_out(case, after, place) or case.outputs(before.added, before.values)
    sent = carried.through(case, after)
    for j in range(len(case.exits)):
        noise = case.whitening[j]
        density = np.maximum(noise.density, np.interp(noise.frequency, *_spectrum(sent[j])))
        rms = float(np.sqrt(np.mean(density[1:])))
        for change in (y[:, j] - without[:, j] for y, without in zip(kept, lost, strict=True)):
            change = without_odd_rows(change) if has_odd_rows(case, after.added) else change
            if float(np.sqrt(np.mean(change**2))) > PART_OF_NOISE * rms:
                return True
            own = np.interp(noise.frequency, *_spectrum(change - change.mean()))
            if np.any(own[1:] > IN_A_BAND**2 * density[1:]):
                return True
    return False


def _spectrum(rows: Array) -> tuple[Array, Array]:
    return incoherent_spectrum(rows, np.zeros((len(rows), 0)))


def _taken_out(case: Case, fitted: Fitted, place: int) -> tuple[Array, ...] | None:
    """The outputs without the effect at a place, all else as it is; None where that frees a value that was not."""
    one, known = fitted.added[place], fitted.by_path
    rest = tuple(other for other in fitted.added if other is not one)
    free, tolerated = case.parameters(rest), {t.path for t in case.tolerated}
    if any(p.path in tolerated and p.path not in known for p in free):
        return None
    return case.outputs(rest, tuple(known[p.path].value if p.path in tolerated else p.value for p in free))
