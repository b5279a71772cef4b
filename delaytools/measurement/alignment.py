"""Two records of one run on two clocks: the clock offset and clock drift between them, found and taken out by name."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.measurement.clock_lags import MOST_DRIFT, matched_line, whole_lag, window_lags, windows_of
from delaytools.measurement.rasters import at_times, usual_step
from delaytools.measurement.smooth_curve import curve_of, slope, value
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError

__all__ = ["Alignment", "align", "aligned", "merged"]

Array = NDArray[np.float64]
_LEAST_CORRELATION = 0.9  # of the averaged signals; two unlike slow ones reached it once in 240
_LEAST_CLEAR = 0.15  # correlation of their slopes
_WIDTHS = (
    4.0,
    8.0,
    16.0,
    32.0,
    64.0,
    128.0,
    256.0,
)  # rows of the slower record over which signals are averaged
_CLEAR = 0.9  # correlation of slopes at which noise no longer asks for a longer average
_LEAST_WIDTHS = 20  # in the shorter record
_FINEST = 1e-3  # of a row: what interpolation between rows leaves


@final
@dataclass(frozen=True)
class Alignment:
    """The other record's clock reads t + offset + drift*(t - at) when the reference's reads t.

    offset, offset_std, at: s; at is the reference's first row. drift, drift_std: s/s. Deviations are one standard
    deviation. correlation: of the signal in both records once aligned. signal: the signal they share.
    """

    offset: float
    drift: float
    offset_std: float
    drift_std: float
    correlation: float
    signal: str
    at: float = 0.0

    @property
    def words(self) -> str:
        """The clock offset and the clock drift in a sentence."""
        return (
            f"clock offset {1e3 * self.offset:.6g} ± {1e3 * self.offset_std:.2g} ms at t = {self.at:g} s, "
            f"clock drift {1e6 * self.drift:.6g} ± {1e6 * self.drift_std:.2g} µs/s, "
            f"from {self.signal} (correlation {self.correlation:.3f})"
        )


def align(reference: Record, other: Record, *, signal: str) -> Alignment:
    """The clock offset and clock drift of `other` against `reference`, from a signal that both logged.

    Windows of about equal motion are matched by correlation, then a line is fitted through their lags; the
    standard deviations come from the lags' scatter about it. Both are averaged over a few rows, or over more where
    noise asks for it. A held signal jumps at its rows; where its jumps keep their place between the rows of the
    other record, that row's length is part of the deviation. Drifts up to 2e-3 s/s are found. A signal that repeats
    itself is aligned at the match with the longest overlap, which may be a whole period off.
    Raises AnalysisError: the signal is not in both, constant, too short, or not alike (with the correlation found).
    """
    for record in (reference, other):
        _check(record, signal, reference, other)
    row = max(usual_step(reference), usual_step(other))
    shortest = min(np.ptp(reference.time), np.ptp(other.time))
    widths = [row * width for width in _WIDTHS if _LEAST_WIDTHS * row * width <= shortest]
    if not widths:
        rows = f"{len(reference)} and {len(other)} rows"
        raise AnalysisError("records too short to be aligned", where=signal, found=rows, advice=_LONGER)
    best, clarity = _at_width(reference, other, signal, widths[0])
    for width in widths[1:]:
        if clarity >= _CLEAR:
            break
        found, clear = _at_width(reference, other, signal, width)
        if clear > clarity:
            best, clarity = found, clear
    if not np.isfinite(best.offset_std):
        raise _unlike(signal, reference, other, best.correlation)
    floor = np.hypot(_FINEST * row, _between_rows(reference, other, best))
    drift_floor = _FINEST * row / shortest
    return replace(
        best,
        offset_std=float(np.hypot(best.offset_std, floor)),
        drift_std=float(np.hypot(best.drift_std, drift_floor)),
    )


def _at_width(reference: Record, other: Record, signal: str, width: float) -> tuple[Alignment, float]:
    """(alignment of signals averaged over a width s, correlation of their slopes); not alike: infinite deviations."""
    x, y = curve_of(reference, signal, width), curve_of(other, signal, width)
    lag, whole = whole_lag(x, y)
    failed = Alignment(lag, 0.0, np.inf, np.inf, whole, signal)
    windows = windows_of(x, y, lag)
    match = matched_line(windows, x, y, lag) if windows is not None else None
    if windows is None or match is None:
        return failed, -1.0
    line, kept = match
    for _ in range(3):
        lags, weights = window_lags(windows, x, y, line)
        change, spread = _line(windows.middle, lags, weights * kept)
        line = line + change
    time = windows.time + line[0] + line[1] * (windows.time - windows.middle.mean())
    alike = float(np.corrcoef(value(x, windows.time), value(y, time))[0, 1])
    clear = float(np.corrcoef(slope(x, windows.time), slope(y, time))[0, 1])
    like = alike >= _LEAST_CORRELATION and clear >= _LEAST_CLEAR and abs(line[1]) <= MOST_DRIFT
    if not like or not np.isfinite(spread[0, 0]):
        return replace(failed, correlation=alike), -1.0
    start = np.array([1.0, reference.time[0] - windows.middle.mean()])
    stds = np.sqrt([start @ spread @ start, spread[1, 1]])
    offset, at = float(start @ line), float(reference.time[0])
    return Alignment(offset, float(line[1]), float(stds[0]), float(stds[1]), alike, signal, at), clear


def _between_rows(reference: Record, other: Record, found: Alignment) -> float:
    """One standard deviation, s, of where between two rows a held signal jumps; 0 where rows meet jumps evenly."""
    name = found.signal
    if name not in reference.held | other.held:
        return 0.0
    exact, rows = (
        (reference, aligned(other, found)) if name in reference.held else (aligned(other, found), reference)
    )
    jumps = exact.time[1:][np.diff(exact[name]) != 0]
    jumps = jumps[(jumps > rows.time[0]) & (jumps < rows.time[-1])]
    after = np.clip(np.searchsorted(rows.time, jumps), 1, len(rows) - 1)
    lengths = rows.time[after] - rows.time[after - 1]
    places = np.exp(2j * np.pi * (rows.time[after] - jumps) / lengths)
    return float(abs(np.mean(places)) * usual_step(rows) / np.sqrt(12.0)) if len(jumps) else 0.0


_LONGER = "give records of the same run that last longer"


def _check(record: Record, signal: str, reference: Record, other: Record) -> None:
    where = record.source or ("reference" if record is reference else "other")
    if signal not in record:
        shared = [name for name in reference.names if name in other]
        advice = "align by a signal that both records hold"
        raise AnalysisError(
            "no such signal in the record", where=where, found=repr(signal), known=shared, advice=advice
        )
    if len(record) < 3 or np.ptp(record[signal]) == 0:
        raise AnalysisError(
            "a constant signal tells nothing of the clocks",
            where=f"{where}, {signal}",
            found=f"{record[signal][0]:g} in all {len(record)} rows",
            advice="align by a signal that moves",
        )


def _unlike(signal: str, reference: Record, other: Record, correlation: float) -> AnalysisError:
    names = [record.source or "a record" for record in (reference, other)]
    enough = correlation >= _LEAST_CORRELATION
    motion = "too little motion of this signal to tell clock offset from clock drift"
    return AnalysisError(
        motion if enough else "the records do not show the same motion of this signal",
        where=signal,
        found=f"correlation {correlation:.2f} at best between {names[0]} and {names[1]}",
        advice="align by a signal that moves all the time"
        if enough
        else "are they of the same run, and of one sign? align by another signal, or by longer records",
    )


def _line(time: Array, lags: Array, weights: Array) -> tuple[Array, Array]:
    """(level and rate of the weighted line about the mean time, their covariance from the scatter)."""
    factors = np.column_stack([np.ones_like(time), time - time.mean()])
    normal = factors.T @ (weights[:, None] * factors)
    inverse = np.linalg.pinv(normal)
    line = inverse @ (factors.T @ (weights * lags))
    rest = lags - factors @ line
    free = np.count_nonzero(weights) - 2
    if free < 1:
        return line, np.full((2, 2), np.inf)
    return line, inverse * float(weights @ rest**2) / (free - 2 if free > 2 else 0.25)  # Student's variance


def aligned(other: Record, alignment: Alignment) -> Record:
    """The other record on the reference's clock: new times, the same values; its `source` says what was done."""
    late = other.time - alignment.at - alignment.offset
    time = alignment.at + late / (1 + alignment.drift)
    source = f"{other.source}; taken out: {alignment.words}"
    return Record(time, other.columns, other.units, other.held, source)


def merged(reference: Record, other: Record) -> Record:
    """Both records at the reference's rows, where both were logged; `other` must already be on its clock.

    Signals of `other` are held where they are held, else interpolated linearly; one that the reference has too
    becomes NAME_other. No time is shifted. Raises AnalysisError where the records share no time.
    """
    both = reference.between(other.time[0], other.time[-1])
    if len(both) < 2:
        spans = [f"{record.time[0]:g} to {record.time[-1]:g} s" for record in (reference, other)]
        advice = "align them first"
        raise AnalysisError("records that share no time", found=" and ".join(spans), advice=advice)
    names = {name: f"{name}_other" if name in reference else name for name in other.names}
    clash = [name for name in names.values() if name in reference]
    if clash:
        raise AnalysisError("two signals of one name", found=clash[0], advice="rename one of them")
    columns = {new: at_times(other, name, both.time) for name, new in names.items()}
    units = {names[name]: other.units[name] for name in other.names if name in other.units}
    held = frozenset(names[name] for name in other.held)
    source = f"{reference.source}; with {other.source}"
    return Record(both.time, {**both.columns, **columns}, {**both.units, **units}, both.held | held, source)
