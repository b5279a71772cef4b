"""The noise at the exits of a segment: what no input explains, never below what the logs can resolve."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import SEEN
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, has_odd_rows
from delaytools.diagnosis.noise import (
    RESOLVED,
    RESOLVED_HELD,
    Whitening,
    incoherent_spectrum,
    whitening,
    wiener_part,
    without_odd_rows,
)
from delaytools.estimation.noise_level import difference_noise
from delaytools.signals.record import Record

__all__ = ["CLEANED", "EXACT", "Carried", "column_noise", "features", "is_loud", "noise_of", "without_noise"]

Array = NDArray[np.float64]
EXACT = 5e-5  # of a signal's rms: noise below it is none
STILL = 1e-6  # of a signal's size: its spread is taken to be no less
CONSTANT = 1e-9  # of a signal's size: what moves less stands still
KEPT = 20  # responses to noise
LOUD = 5.0  # times the least noise that there can be: a residual above it is the missing effect's for the most part
CARRIED = 2.0  # times all that the inputs' noise can do: the same
CLEANED = 0.15  # of the noise of a measured input that is left when the input was cleaned


def features(case: Case, outputs: tuple[Array, ...], log: int) -> Array:
    """(n, k): entries and modelled exits of a log, and simple nonlinear functions of them, as inputs of a residual."""
    record = case.records[log]
    names = [n for n in case.segment.entries if n in record]
    return _bent([*(record[n] for n in names), *outputs[log].T], len(record))


def references(case: Case, log: int) -> Array:
    """(n, k): signals from outside the loop, and simple nonlinear functions of them.

    What the loop itself writes carries the noise round the loop: noise must not be called explained by it.
    """
    record = case.records[log]
    return _bent([record[n] for n in record.names if n in case.outside and "@" not in n], len(record))


def _bent(signals: Sequence[Array], rows: int) -> Array:
    columns = []
    for u in signals:
        centred = u - u.mean()
        size = max(float(np.abs(centred).max()), CONSTANT * float(np.abs(u).max()), 1e-300)
        x = centred / size
        rate = np.diff(u, prepend=u[:1])
        turn = np.tanh(rate / max(0.2 * float(np.sqrt(np.mean(rate**2))), 1e-300))
        columns += [x, np.abs(u / size), x**3, turn]
    return np.stack(columns, axis=1) if columns else np.zeros((rows, 0))


@final
@dataclass(frozen=True, eq=False)
class Carried:
    """What noise on the measured inputs of a segment, and on the sources of its effects, sends to its exits.

    noises: of each input, a standard deviation where it is white, or a spectrum. seed: of the noise that is drawn.
    """

    noises: Mapping[str, float | Whitening]
    seed: int = 1
    _found: dict[Any, tuple[Array, ...]] = field(default_factory=dict, repr=False)

    def through(self, case: Case, fitted: Fitted, *, share: float = 1.0) -> tuple[Array, ...]:
        """Per exit (n,), along the first log: the response of a hypothesis to a share of the noise.

        Through a quantiser that is no share of the response: a little noise moves a switching row by as much as it
        is, and the jump there is the quantiser's whole step. All noise counts of a source that was not cleaned, and of
        a measured motion along which an effect acts: what was left out of it is what stands clear of its spectrum.
        """
        key = (share, fitted.values, *((one.shape, tuple(one.values.values())) for one in fitted.added))
        if key not in self._found:
            self._found.clear() if len(self._found) > KEPT else None
            self._found[key] = self._response(case, fitted, share)
        return self._found[key]

    def _response(self, case: Case, fitted: Fitted, share: float) -> tuple[Array, ...]:
        sources = {one.fixed.get("source") for one in fitted.added}
        named = {n: s for n, s in self.noises.items() if n in case.segment.entries or n in sources}
        noisy = {n: s for n, s in named.items() if isinstance(s, Whitening) or s > 0}
        record = case.records[0]
        generator = np.random.default_rng(self.seed)
        shares = {n: share if n in case.segment.entries or isinstance(s, Whitening) else 1.0 for n, s in noisy.items()}
        columns = {n: shares[n] * _drawn(s, len(record), generator) for n, s in noisy.items()}
        seen = sorted({exit for one in fitted.added for exit in one.along.values()})
        columns |= {n: _drawn(column_noise(record[n], n in record.held), len(record), generator) for n in seen}
        if not columns:
            return tuple(np.zeros(len(record)) for _ in case.exits)
        columns = {n: record[n] + noise for n, noise in columns.items()}
        moved = Record(record.time, {**record.columns, **columns}, record.units, record.held)
        driven = case.stimuli_for(moved, (*noisy, *(f"{exit}{SEEN}" for exit in seen)))
        replay = case.replays(fitted.added)[0]
        return tuple((replay.run_driven(fitted.values, driven) - replay.run(fitted.values)).T)


def _drawn(noise: float | Whitening, rows: int, generator: np.random.Generator) -> Array:
    if isinstance(noise, Whitening):
        return noise.draw(rows, generator)
    return noise * generator.standard_normal(rows)


def noise_of(case: Case, fitted: Fitted, carried: Carried) -> tuple[Whitening, ...]:
    """One filter per exit from the residual of a fitted hypothesis.

    What is left of the inputs' noise when these were cleaned is taken to be there at least. Few rows that a quantiser
    of the hypothesis rounds the other way are no noise.
    """
    outputs = case.outputs(fitted.added, fitted.values)
    sent = carried.through(case, fitted, share=CLEANED)
    found = []
    for j, exit in enumerate(case.exits):
        series = _series(case, outputs, j)
        if has_odd_rows(case, fitted.added):
            series = [(without_odd_rows(rows), inputs) for rows, inputs in series]
        spectra = [incoherent_spectrum(*pair) for pair in series]
        longest = max(range(len(spectra)), key=lambda k: len(spectra[k][0]))
        frequency = spectra[longest][0]
        density = np.mean([np.interp(frequency, f, d) for f, d in spectra], axis=0)
        held = exit in case.records[0].held
        shown = np.concatenate([m[:, j] for m in case.measured])
        spread = max(float(shown.std()), STILL * float(np.abs(shown).max()))
        floor = ((RESOLVED_HELD if held else RESOLVED) * spread) ** 2
        least = incoherent_spectrum(sent[j], np.zeros((len(sent[j]), 0)))
        density = np.maximum(density, floor + np.interp(frequency, *least))
        found.append(whitening(frequency, density))
    return tuple(found)


def is_loud(case: Case, exit: int, left: Array, sent: float) -> bool:
    """Whether what is left at an exit, (n,), is far above the noise that its own differences and its inputs' show.

    sent: standard deviation of all that the inputs' noise can do there. Of a held signal nothing is known.
    """
    name = case.exits[exit]
    if name in case.records[0].held:
        return False
    own = max(column_noise(record[name], False) for record in case.records)
    spread = max(float(np.std(rows[:, exit])) for rows in case.measured)
    return float(np.std(left)) > max(float(np.hypot(LOUD * own, CARRIED * sent)), LOUD * EXACT * spread)


def _series(case: Case, outputs: tuple[Array, ...], exit: int) -> list[tuple[Array, Array]]:
    """Per log: the residual at an exit, and what may explain some of it.

    Logs in pieces give one series of the rows that count, all of it taken for noise: the error of a model of a real
    bench goes with its inputs, too.
    """
    whole = tuple(m - y for m, y in zip(case.measured, outputs, strict=True))
    left = [rows[:, exit] for rows in whole]
    if not case.pieces:
        return [(rows, references(case, log)) for log, rows in enumerate(left)]
    joined = np.concatenate([rows[a:b] for rows, own in zip(left, case.pieces, strict=True) for a, b in own])
    return [(joined, np.zeros((len(joined), 0)))]


def column_noise(values: Array, held: bool) -> float:
    """Noise of a measured column by its fourth differences; 0 for held signals and for what is nearly exact."""
    if held:
        return 0.0
    found = difference_noise(values)
    return found if found > EXACT * float(np.std(values)) else 0.0


def without_noise(measured: Array, model: Array, held: bool) -> Array:
    """(n,): a column as measured, without the noise that its model does not explain."""
    noise = column_noise(measured, held)
    return np.asarray(model + wiener_part(measured - model, noise)) if noise > 0 else measured
