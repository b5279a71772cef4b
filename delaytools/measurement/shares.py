"""Where the squared error lies: over time, over frequency, over the amplitude and the rate of the signal."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from delaytools.measurement.comparison import LevelShare, Strips
from delaytools.measurement.measures import Trace, cut
from delaytools.measurement.residual_spectra import Spectra, bands

__all__ = ["strips", "worst_bands", "worst_levels", "worst_times"]

Array = NDArray[np.float64]
BLOCKS = 40  # of time
LEVELS = 8
LISTED = 5
MORE = 1.5  # times its even share: a stretch that is worth naming


def strips(traces: Sequence[Trace], seen: Spectra, unit: str) -> Strips:
    """The squared error of the rows that count over time (logs one after the other), frequency, amplitude and rate."""
    time = _joined_time(traces)
    square = np.concatenate([np.nan_to_num((y - m) ** 2) for _, y, m in traces])
    total = max(float(square.sum()), 1e-300)
    edges = np.linspace(time[0], time[-1], BLOCKS + 1)
    over_time = np.histogram(time, edges, weights=square)[0] / total
    groups = bands(seen.frequency)
    power = np.array([seen.error[g].sum() for g in groups])
    noise = np.array([seen.noise[g].sum() for g in groups])
    gamma = np.array([_mean(seen.coherence[g], seen.error[g]) for g in groups])
    starts = [seen.frequency[g.start] for g in groups]
    return Strips(
        edges, over_time, np.array([*starts, seen.frequency[-1]]), power / max(power.sum(), 1e-300), gamma,
        noise / max(power.sum(), 1e-300), _levels(cut(traces), unit),
    )  # fmt: skip


def _joined_time(traces: Sequence[Trace]) -> Array:
    parts, end = [], 0.0
    for t, _, _ in traces:
        parts.append(t - t[0] + end if len(traces) > 1 else t)
        end += float(t[-1] - t[0])
    return np.concatenate(parts)


def _mean(values: Array, weights: Array) -> float:
    return float(np.average(values, weights=weights)) if weights.sum() > 0 else 0.0


def _levels(traces: Sequence[Trace], unit: str) -> tuple[LevelShare, ...]:
    square = np.concatenate([(y - m) ** 2 for _, y, m in traces])
    share = square / max(float(square.sum()), 1e-300)
    amplitude = np.concatenate([np.abs(m) for _, _, m in traces])
    rate = np.concatenate([np.abs(np.gradient(m, t)) for t, _, m in traces])
    return (*_binned("amplitude", amplitude, share, unit), *_binned("rate", rate, share, _per_second(unit)))


def _per_second(symbol: str) -> str:
    """deg → deg/s, deg/s → deg/s^2."""
    return f"{symbol}^2" if symbol.endswith("/s") else f"{symbol or '1'}/s"


def _binned(name: str, values: Array, share: Array, unit: str) -> tuple[LevelShare, ...]:
    """Bins that hold as many rows each; fewer where many rows have one value."""
    if not np.isfinite(values).all():
        return ()
    edges = np.unique(np.quantile(values, np.linspace(0, 1, LEVELS + 1)))
    if len(edges) < 2:
        return ()
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    part = np.bincount(place, weights=share, minlength=len(edges) - 1)
    rows = np.bincount(place, minlength=len(edges) - 1) / len(values)
    return tuple(
        LevelShare(name, float(a), float(b), unit, float(p), float(r))
        for a, b, p, r in zip(edges[:-1], edges[1:], part, rows, strict=True)
    )


def worst_times(found: Strips) -> tuple[tuple[float, float, float], ...]:
    """Stretches of time with clearly more than their share, neighbours joined, the worst first."""
    even = np.full(len(found.time_shares), 1.0 / len(found.time_shares))
    return tuple(
        (float(found.time_edges[a]), float(found.time_edges[b]), float(found.time_shares[a:b].sum()))
        for a, b in _stretches(found.time_shares, even)
    )


def worst_bands(found: Strips) -> tuple[tuple[float, float, float, float | None], ...]:
    """Bands with clearly more than their share of the bandwidth, neighbours joined, the worst first."""
    width = np.diff(found.band_edges)
    return tuple(
        (
            float(found.band_edges[a]), float(found.band_edges[b]), float(found.band_shares[a:b].sum()),
            _mean(found.coherence[a:b], found.band_shares[a:b]),
        )
        for a, b in _stretches(found.band_shares, width / max(width.sum(), 1e-300))
    )  # fmt: skip


def worst_levels(found: Strips) -> tuple[LevelShare, ...]:
    """Levels with clearly more than their share of the time, the worst first."""
    more = [one for one in found.levels if one.share > MORE * one.share_of_time]
    return tuple(sorted(more, key=lambda one: -one.share / one.share_of_time)[:LISTED])


def _stretches(shares: Array, even: Array) -> list[tuple[int, int]]:
    """Runs of places with more than MORE times their even share; the single worst one where there is none."""
    if not shares.sum() > 0:
        return []
    high = shares > MORE * even
    if not high.any():
        high[int(np.argmax(shares / np.maximum(even, 1e-300)))] = True
    turns = np.flatnonzero(np.diff(np.r_[0, high.astype(int), 0]))
    pairs = [(int(a), int(b)) for a, b in zip(turns[::2], turns[1::2], strict=True)]
    return sorted(pairs, key=lambda pair: -float(shares[pair[0] : pair[1]].sum()))[:LISTED]
