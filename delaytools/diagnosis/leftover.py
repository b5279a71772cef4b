"""What a search leaves over: structure that no effect explains, uneven noise, and effects that only imitate."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.answer import Unexplained
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.hint import hint
from delaytools.diagnosis.lattices import on_lattice
from delaytools.diagnosis.noise import without_odd_rows
from delaytools.diagnosis.noise_of import CLEANED, features, is_loud
from delaytools.diagnosis.rounding import roundings
from delaytools.diagnosis.structure import Band, structured_bands
from delaytools.diagnosis.unevenness import loudest
from delaytools.diagnosis.worth import MOST
from delaytools.loop.port import find_port

__all__ = ["explains", "imitated", "left_over", "unexplained"]

Array = NDArray[np.float64]
LEFT = 0.06  # power of structure left, of the noise: a quarter of its rms
IN_A_BAND = 1.25  # the same in one octave
IN_A_LOUD_BAND = 0.4  # where far more is left than any noise that is known: the filters take it for noise then
CHANCE = 1e-8
SCATTER = 1e-3  # of the usual step
LONG = 0.3  # of the longest log: shorter ones are not asked by themselves, they tell little
EVEN = ("bias", "scale_factor", "cross_coupling", "flexible_mode", "periodic_interference")  # leave noise as even
WINDOW = "transient_gain"  # two of them can follow whatever depends on how much a signal moves


def explains(case: Case, fitted: Fitted, sent: tuple[Array, ...]) -> bool:
    """Whether there are effects that leave nothing, and may not only imitate what they explain."""
    return bool(fitted.added) and not (unexplained(case, fitted, sent) or imitated(case, fitted))


def imitated(case: Case, fitted: Fitted) -> tuple[Unexplained, ...]:
    """Sets of effects that explain everything by their number alone, and a mode that is none: both imitate an unknown
    effect well."""
    if (dull := next((one for one in fitted.added if one.is_dull), None)) is not None:
        words = f"{dull.name} is damped as much as a mode may be here: it may imitate what is not in the catalogue"
        return (Unexplained(case.exits[0], 0.0, (), words),)
    generic = [one for one in fitted.added if "source" in one.fixed]
    windows = [one for one in fitted.added if one.kind == WINDOW]
    count = sum(not _is_shown(case, one) for one in fitted.added)
    if count < MOST and len(generic) < 2 and len(windows) < 2:
        return ()
    words = f"{count} effects are needed here: together they may imitate one that is not in the catalogue"
    return (Unexplained(case.exits[0], 0.0, (), words),)


def _is_shown(case: Case, one: Added) -> bool:
    """Whether the log itself proves an effect: a quantiser whose lattice its column shows."""
    return one.kind == "quantization" and on_lattice(case, find_port(case.segment.loop, one.at)) is not None


def unexplained(case: Case, fitted: Fitted, sent: tuple[Array, ...]) -> tuple[Unexplained, ...]:
    """Exits whose rest is no noise, each by the log in which it is the most."""
    outputs = case.outputs(fitted.added, fitted.values)
    left, found, rounded = left_over(case, outputs), [], roundings(case, fitted)
    longest = max(map(len, left))
    logs = [log for log, rows in enumerate(left) if len(rows) > LONG * longest]
    for j, exit in enumerate(case.exits):
        rows = {log: rounded.less_mean(left[log][:, j], exit, log) for log in logs}
        rests = (_looked_at(case, outputs, rows[log], sent[j], (log, j)) for log in logs)
        worst = max(rests, key=lambda one: one.clear)
        every = without_odd_rows(np.concatenate(list(rows.values())))
        loud = not case.pieces and is_loud(case, j, every, float(np.std(sent[j])) / CLEANED)
        if worst.is_structured(IN_A_LOUD_BAND if loud else IN_A_BAND):
            found.append(_told(case, exit, worst, hint(case, fitted, j)))
        elif not (case.is_driven_by_steps or _gates_noise(case, fitted, j)):
            found += _uneven(case, outputs, worst, exit)
    return tuple(found)


@final
@dataclass(frozen=True, eq=False)
class _Rest:
    """The rest of an exit in a log: whitened rows (n,), what inputs' noise may send there (n,), and its bands."""

    log: int
    white: Array
    sent: Array
    bands: tuple[Band, ...]

    @property
    def clear(self) -> float:
        """Power that hangs together with the inputs' past beyond chance."""
        return sum(b.share * 2 * (b.high - b.low) for b in self.bands if b.probability < CHANCE)

    def is_structured(self, in_a_band: float) -> bool:
        """Whether that is more than noise does, in all or in some band."""
        return self.clear > LEFT or any(b.share > in_a_band and b.probability < CHANCE for b in self.bands)


def _looked_at(
    case: Case, outputs: tuple[Array, ...], residual: Array, sent: Array, place: tuple[int, int]
) -> _Rest:
    log, j = place
    white = without_odd_rows(case.whitening[j].apply(residual), least=1.0)
    allowed = np.resize(case.whitening[j].apply(sent), len(white))  # known along the first log
    return _Rest(log, white, allowed, structured_bands(white, features(case, outputs, log), allowed))


def _gates_noise(case: Case, fitted: Fitted, exit: int) -> bool:
    """Whether the noise of an exit may pass an effect, at its port, that lets through now more, now less."""
    designed = [e.name.partition("#")[0].partition("@") for e in case.segment.loop.elements if "@" in e.name]
    found = [(one.kind, one.at) for one in fitted.added] + [(kind, at) for kind, _, at in designed]
    return any(case.exit_at(at) == exit and kind not in EVEN for kind, at in found)


def _uneven(case: Case, outputs: tuple[Array, ...], rest: _Rest, exit: str) -> list[Unexplained]:
    """The rest of an exit where it is much louder at some level or rate of a signal.

    Not asked where the stamps of the rows scatter: what they are off by is noise that goes with the rates.
    """
    record = case.records[rest.log]
    if np.ptp(np.diff(record.time)) > SCATTER * case.step:
        return []
    signals = {n: record[n] for n in case.segment.entries if n in record}
    signals |= {n: outputs[rest.log][:, k] for k, n in enumerate(case.exits)}
    one = loudest(rest.white, signals, rest.sent, case.step)
    if one is None:
        return []
    what = f"the rate of {one.signal}" if one.is_rate else one.signal
    words = f"what is left is {one.power:.1f} times as strong as in all where {what} is within " \
        f"{one.low:.3g} and {one.high:.3g}: noise is as strong everywhere"
    return [Unexplained(exit, one.share, (), words)]


def _told(case: Case, exit: str, rest: _Rest, words: str) -> Unexplained:
    limits = tuple((b.low / case.step, b.high / case.step) for b in rest.bands if b.probability < CHANCE)
    total = float(np.mean(rest.white**2))
    return Unexplained(exit, min(rest.clear / max(total, 1e-300), 1.0), limits, words)


def left_over(case: Case, outputs: tuple[Array, ...]) -> tuple[Array, ...]:
    """Per log (n, exits): measured minus model, less what uncertain values of other segments can do."""
    return case.without_nuisance(tuple(m - y for m, y in zip(case.measured, outputs, strict=True)))
