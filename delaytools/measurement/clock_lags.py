"""How late one record runs against another: by correlation, first as a whole, then window by window."""

from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from delaytools.measurement.smooth_curve import Curve, slope, value

__all__ = ["MOST_DRIFT", "Windows", "matched_line", "whole_lag", "window_lags", "windows_of"]

Array = NDArray[np.float64]
MOST_DRIFT = 2e-3  # s/s: a quartz clock keeps within a tenth of it
_LONGEST = 2**18  # points of a correlation
_OVERLAP = 0.3  # of the shorter record
_WINDOWS = 20
_SHORTEST = 8.0  # widths of the mean
_LIKE = 0.4  # correlation of a window that is told from chance


@final
@dataclass(frozen=True)
class Windows:
    """Times (s) of the reference, evenly spaced, cut into windows of about equal motion.

    starts: index of each window's first time. middle: (k,) s, the windows' centres of motion.
    """

    time: Array
    starts: NDArray[np.intp]
    middle: Array

    def sums(self, values: Array) -> Array:
        """The sum over each window."""
        return np.add.reduceat(values, self.starts)

    def spread(self, values: Array) -> Array:
        """One value per window, at every time of the window."""
        return np.repeat(values, np.diff(np.append(self.starts, len(self.time))))


def whole_lag(reference: Curve, other: Curve) -> tuple[float, float]:
    """(lag s, correlation) of the best match of the whole records: other(t + lag) is like reference(t).

    A match counts by its correlation, less where it leaves motion of both records outside the overlap.
    """
    spans = (reference.end - reference.start, other.end - other.start)
    step = max(reference.width / 4, max(spans) / _LONGEST)
    grids = [np.arange(c.start, c.end, step) for c in (reference, other)]
    x, y = (value(c, grid) for c, grid in zip((reference, other), grids, strict=True))
    ones = [np.ones(len(x)), np.ones(len(y))]
    n = np.maximum(np.round(correlate(ones[1], ones[0], method="fft")), 1.0)
    sx, sxx = (correlate(ones[1], part, method="fft") for part in (x, x * x))
    sy, syy, sxy = (correlate(a, b, method="fft") for a, b in ((y, ones[0]), (y * y, ones[0]), (y, x)))
    vx, vy = sxx - sx**2 / n, syy - sy**2 / n
    shares = vx / max(np.var(x) * len(x), 1e-300), vy / max(np.var(y) * len(y), 1e-300)
    good = (n >= _OVERLAP * min(len(x), len(y))) & (shares[0] > 1e-3) & (shares[1] > 1e-3)
    found = np.where(good, (sxy - sx * sy / n) / np.sqrt(np.where(good, vx * vy, 1.0)), -1.0)
    score = np.where(good, found * np.sqrt(np.clip(np.maximum(*shares), 0.0, 1.0)), -1.0)
    best = int(np.argmax(score))
    return float(grids[1][0] - grids[0][0] + (best - (len(x) - 1)) * step), float(found[best])


def windows_of(reference: Curve, other: Curve, lag: float) -> Windows | None:
    """The windows of the common time, or None where there is too little of it."""
    span = min(reference.end, other.end - lag) - max(reference.start, other.start - lag)
    margin = _reach(reference, span)
    start = max(reference.start, other.start - lag + margin)
    end = min(reference.end, other.end - lag - margin)
    step = max(reference.width / 8, span / _LONGEST)
    time = np.arange(start, end, step)
    if len(time) * step < 2 * _SHORTEST * reference.width:
        return None
    motion = slope(reference, time) ** 2
    grown = np.cumsum(motion)
    least = int(np.ceil(_SHORTEST * reference.width / step))
    starts = [0]
    for edge in np.searchsorted(grown, grown[-1] * np.arange(1, _WINDOWS) / _WINDOWS):
        if edge - starts[-1] >= least and len(time) - edge >= least:
            starts.append(int(edge))
    bare = Windows(time, np.array(starts), np.empty(0))
    middle = bare.sums(motion * time) / np.maximum(bare.sums(motion), 1e-300)
    return Windows(time, bare.starts, middle)


def _reach(reference: Curve, span: float) -> float:
    return MOST_DRIFT * span + 2 * reference.width


def matched_line(windows: Windows, reference: Curve, other: Curve, lag: float) -> tuple[Array, Array] | None:
    """(line, which windows follow it): lag = line[0] + line[1]*(t - mean time); None where the windows disagree."""
    step = windows.time[1] - windows.time[0]
    reach = int(np.ceil(_reach(reference, float(np.ptp(windows.time))) / step)) - 1
    ahead = np.arange(-reach, len(windows.time) + reach) * step + windows.time[0] + lag
    y, x = value(other, ahead), value(reference, windows.time)
    edges = np.append(windows.starts, len(windows.time))
    found = [_best(x[a:b], y[a : b + 2 * reach]) for a, b in pairwise(edges)]
    lags = np.array([lag + (k - reach) * step for k, _ in found])
    like = np.array([r for _, r in found]) >= _LIKE
    if like.sum() < max(2, len(lags) / 2):
        return None
    about = windows.middle - windows.middle.mean()
    pairs = [(i, j) for i in np.flatnonzero(like) for j in np.flatnonzero(like) if i < j]
    rate = float(np.median([(lags[j] - lags[i]) / (about[j] - about[i]) for i, j in pairs]))
    level = float(np.median(lags[like] - rate * about[like]))
    off = np.abs(lags - level - rate * about)
    kept = like & (off <= max(reference.width, 4.5 * float(np.median(off[like]))))
    agree = off <= 2 * reference.width
    return (np.array([level, rate]), kept) if agree[like].sum() >= len(lags) / 2 else None


def _best(x: Array, y: Array) -> tuple[int, float]:
    """Where in y the piece x is matched best, and its correlation there."""
    x = x - x.mean()
    n = len(x)
    total = np.cumsum(np.append(0.0, y)), np.cumsum(np.append(0.0, y * y))
    energy = total[1][n:] - total[1][:-n] - (total[0][n:] - total[0][:-n]) ** 2 / n
    both = np.sqrt(np.maximum(energy, 1e-6 * n * np.var(y)) * max(float(x @ x), 1e-300))
    found = correlate(y, x, mode="valid", method="fft") / np.maximum(both, 1e-300)
    best = int(np.argmax(found))
    return best, float(found[best])


def window_lags(windows: Windows, reference: Curve, other: Curve, line: Array) -> tuple[Array, Array]:
    """(what each window adds to the line's lag s, its weight): the zero of the correlation with the slope.

    sum slope_x(t)*(y(t + lag) - a*x(t) - b) = 0 over the window, a and b by least squares; noise of either record
    does not shift it. The weight is sum slope_x*slope_y.
    """
    x, dx = value(reference, windows.time), slope(reference, windows.time)
    base = windows.time + line[0] + line[1] * (windows.time - windows.middle.mean())
    count = windows.sums(np.ones_like(x))
    mx = windows.sums(x) / count
    vx = np.maximum(windows.sums(x * x) - count * mx**2, 1e-300)
    lags, weight = np.zeros(len(count)), np.zeros(len(count))
    for _ in range(5):
        at = base + windows.spread(lags)
        y = value(other, at)
        my = windows.sums(y) / count
        gain = (windows.sums(x * y) - count * mx * my) / vx
        rest = y - windows.spread(my) - windows.spread(gain) * (x - windows.spread(mx))
        weight = windows.sums(dx * slope(other, at))
        steps = -windows.sums(dx * rest) / np.where(weight > 0, weight, np.inf)
        lags = lags + np.clip(steps, -reference.width, reference.width)
    return lags, np.maximum(weight, 0.0)
