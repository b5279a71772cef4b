"""What drives a segment: measured columns, with or without the noise of their pick-off, and how rows are joined."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd

from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.noise import Whitening
from delaytools.diagnosis.noise_of import column_noise
from delaytools.diagnosis.stepwise import loses_updates
from delaytools.measurement.measures import resolution
from delaytools.signals.record import Record

__all__ = ["driven_best", "joined_as_it_drove", "nominal"]

Array = NDArray[np.float64]
SEGMENT, FEWEST = 1024, 8  # rows of a stretch for spectra, and how many stretches there are at least
LATE = (0, 1, 2, 3, 5, 8)  # rows by which a computer may read late
INDEPENDENT = 1.89  # Hann-tapered stretches of half overlap per stretch's length that count as independent (Welch 1967)
CLEARLY = 0.98  # of the residual: below it another way of joining rows is taken


def nominal(case: Case) -> Fitted:
    parameters = case.parameters(())
    return Fitted((), parameters, np.zeros(0), np.zeros((0, len(parameters))))


def driven_best(
    case: Case,
    cleaned: tuple[dict[str, Array], ...],
    moved: tuple[dict[str, Array], ...],
    known: Mapping[str, Whitening],
    written: Collection[str],
    under: Fitted | None = None,
) -> tuple[Case, dict[str, float | Whitening]]:
    """Each noisy entry cleaned, or as measured where its noise drives the segment too; and the entries' noise.

    cleaned: per log, columns without noise; moved: of those that may be entries, what a standard error of each fitted
    value does to them. known: noise of cleaned columns. written: signals that a block of the design writes. under: the
    hypothesis by which the segment answers to noise (default: as designed).
    """
    first = case.records[0]
    noises: dict[str, float | Whitening] = {n: column_noise(first[n], n in first.held) for n in first.names}
    usable = [n for n in cleaned[0] if n in moved[0] or n not in case.segment.entries]
    noises |= {n: known[n] for n in usable}
    exact = {n for n in first.names if noises[n] == 0 and n not in first.held}
    case = _joined_best(replace(case, outside=frozenset(first.names) - set(written)), exact, written)
    sources = [n for n in usable if n not in case.exits and n not in case.segment.entries]
    case = _with_columns(case, cleaned, sources)
    chosen: list[str] = []
    noisy = [n for n in case.segment.entries if n in usable]
    if noisy and loses_updates(case):  # a computer that is met exactly reads what was measured
        return case, {**noises, **dict.fromkeys(noisy, 0.0)}
    for entry in noisy:
        tried = _with_columns(case, cleaned, [entry])
        if _passed_on(case, tried, entry, under or nominal(case)):
            noises[entry], case = 0.0, joined_as_it_drove(case, entry, under or nominal(case))
        else:
            case, chosen = tried, [*chosen, entry]
    known_less = tuple({entry: new[entry] for entry in chosen} for new in moved) if chosen else ()
    return replace(case, uncertain=known_less), noises


def _joined_best(case: Case, exact: set[str], written: Collection[str]) -> Case:
    """Rows of exact columns joined by a spline where a block writes them, by straight lines where they come from
    outside; the other way round where that leaves clearly less."""
    case = replace(case, smooth=case.smooth | (exact & set(written)), _replays={})
    least = _rms_left(case)
    for entry in (n for n in case.segment.entries if n in exact):
        tried = replace(case, smooth=case.smooth ^ {entry}, _replays={})
        left = _rms_left(tried)
        if left < CLEARLY * least:
            case, least = tried, left
    return case


def _rms_left(case: Case) -> float:
    outputs = case.outputs((), nominal(case).values)
    pairs = zip(case.measured, outputs, strict=True)
    return float(np.mean([(m - y).std(axis=0) / np.maximum(m.std(axis=0), 1e-300) for m, y in pairs]))


def _passed_on(as_measured: Case, cleaned: Case, entry: str, under: Fitted) -> bool:
    """Whether the segment answers to the noise of an entry, which then is no noise of the pick-off alone.

    The power of the residual that goes with the noise's response, of that response, weighted by the residual's own
    spectrum: the noise goes with nothing else, so that an effect that is missing changes the share's error, not its
    mean. At any phase and gain, and for what samples by the rows before each as well: what is missing may delay the
    noise, too.
    """
    late = LATE if set(cleaned.exits) <= cleaned.records[0].held else (0,)
    return sum(_share(_noisy(as_measured, cleaned, (entry, rows)), cleaned, under) for rows in late) > 0.5


def joined_as_it_drove(case: Case, entry: str, under: Fitted) -> Case:
    """The case with the rows of an entry that drives as measured joined by a spline, where that is what drove.

    The share, in phase, of what the spline changes at the exits in what straight lines leave there: 1 where the spline
    is right, 0 where straight lines are. What is called its noise may be motion too fast for straight lines.
    """
    if entry in case.records[0].held or resolution(case.records[0][entry]) > 0:
        return case
    curved = replace(case, smooth=case.smooth | {entry}, _replays={})
    along, power = 0.0, 0.0
    for answer, left, weight, welch in _answers(curved, case, under):
        both = csd(answer, left, **welch)[1].real
        along += float(np.sum(weight * both))
        power += float(np.sum(weight * csd(answer, answer, **welch)[1].real))
    return curved if power > 0 and along > 0.5 * power else case


def _noisy(as_measured: Case, cleaned: Case, late: tuple[str, int]) -> Case:
    """The cleaned case with the noise of an entry, some rows late."""
    entry, rows = late
    columns = tuple(
        {entry: c[entry] + np.concatenate([np.zeros(rows), (m[entry] - c[entry])[: len(m) - rows]])}
        for m, c in zip(as_measured.records, cleaned.records, strict=True)
    )
    return _with_columns(as_measured, columns, [entry])


def _share(noisy_case: Case, cleaned: Case, under: Fitted) -> float:
    """The power of the residual that goes with the noise's response, of that response."""
    along, power = 0.0, 0.0
    for answer, left, weight, welch in _answers(noisy_case, cleaned, under):
        count = max(INDEPENDENT * len(left) / welch["nperseg"], 2.0)
        both = np.abs(csd(answer, left, **welch)[1]) ** 2
        own, rest = csd(answer, answer, **welch)[1].real, csd(left, left, **welch)[1].real
        shared = np.divide(both, own, out=np.zeros_like(own), where=own > 0)
        along += float(np.sum(weight * (count * shared - rest))) / (count - 1)
        power += float(np.sum(weight * own))
    return along / power if power > 0 else 0.0


def _answers(other: Case, case: Case, under: Fitted) -> Iterator[tuple[Array, Array, Array, dict[str, Any]]]:
    """Per log and exit: what driving it in another way changes (n,), what is left (n,), how each line of a spectrum
    weighs (by what is left itself), and how spectra are taken; nothing of a hypothesis that runs away."""
    ways = [one.outputs(under.added, under.values) for one in (other, case)]
    if not all(np.isfinite(rows).all() for way in ways for rows in way):
        return
    for y, changed, usual in zip(case.measured, *ways, strict=True):
        size = min(SEGMENT, len(y) // FEWEST)
        for j in range(y.shape[1] if size > 1 else 0):
            left, answer = y[:, j] - usual[:, j], changed[:, j] - usual[:, j]
            welch = {"nperseg": size, "detrend": "linear"}
            rest = csd(left, left, **welch)[1].real
            yield answer, left, 1 / (rest + 1e-12 * float(np.var(y[:, j])) / size + 1e-300), welch


def _with_columns(case: Case, cleaned: tuple[dict[str, Array], ...], names: Sequence[str]) -> Case:
    records = tuple(
        Record(r.time, {**r.columns, **{n: new[n] for n in names}}, r.units, r.held, r.source)
        for r, new in zip(case.records, cleaned, strict=True)
    )
    curved = frozenset(n for n in names if resolution(cleaned[0][n]) == 0)  # a spline would swing about steps
    return replace(case, records=records, smooth=case.smooth | curved, _replays={})
