"""Whether the size of what is left goes with the signals: noise is as large wherever they are.

A force or a characteristic that no known effect holds is imitated best where signals are most of the time. What is
left goes with nothing linearly and passes for noise, but is loud at some levels or rates only (after White 1980,
Econometrica 48: a test of the residual's square against what drives it).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from delaytools.diagnosis.structure import octaves

__all__ = ["Loudness", "loudest"]

Array = NDArray[np.float64]
BINS = 10
OWN = 0.5  # of the filter's density: an octave with less is the floor's, where nothing is left
LOUDER, CHANCE = 2.0, 1e-8  # times the mean power, and the probability of as much by chance
ALLOWED = 4.0  # times the power that noise left in the inputs is taken to send
FEWEST = 20.0  # degrees of freedom of a bin at least


@final
@dataclass(frozen=True)
class Loudness:
    """Where a residual is loudest: a signal's level or rate, within limits; power as a multiple of the mean.

    share: of all power, in the rows there.
    """

    signal: str
    is_rate: bool
    low: float
    high: float
    power: float
    share: float


def loudest(residual: Array, signals: Mapping[str, Array], sent: Array, step: float) -> Loudness | None:
    """The tenth of the rows, by level or rate of a signal, in which a white residual (n,) is clearly the loudest.

    sent: (n,) what noise left in the inputs may do, whitened as well: twice as much is allowed for. step: s.
    None where it is as loud everywhere. In the octaves in which the residual reaches the filter's density only.
    """
    kept = np.zeros(len(residual) // 2 + 1, dtype=bool)
    power = np.abs(np.fft.rfft(residual)) ** 2 / len(residual)
    for first, last in octaves(len(power), len(residual)):
        kept[first:last] = power[first:last].mean() > OWN
    if not kept.any():
        return None
    own, allowed = (_within(rows, kept) ** 2 for rows in (residual, sent))
    share = float(kept.mean())
    found = [
        one
        for name, rows in signals.items()
        for is_rate in (False, True)
        for one in _by_level((name, is_rate), np.gradient(rows, step) if is_rate else rows, (own, allowed), share)
    ]
    return max(found, key=lambda one: one.power, default=None)


def _within(rows: Array, kept: NDArray[np.bool_]) -> Array:
    return np.asarray(np.fft.irfft(np.where(kept, np.fft.rfft(rows), 0.0), len(rows)))


def _by_level(
    named: tuple[str, bool], values: Array, powers: tuple[Array, Array], share: float
) -> list[Loudness]:
    """Bins of equally many rows in which the power is clearly above the mean; share: of the rows, independent ones."""
    own, allowed = powers
    edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
    if len(edges) < 3:
        return []
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    mean, found = float(own.mean()), []
    for k in range(len(edges) - 1):
        here = place == k
        freedom = float(here.sum()) * share
        if freedom < FEWEST:
            continue
        ratio = (float(own[here].mean()) - ALLOWED * float(allowed[here].mean())) / mean
        if ratio > LOUDER and chi2.sf(ratio * freedom, freedom) < CHANCE:
            part = float(own[here].sum() / own.sum())
            found.append(Loudness(*named, float(edges[k]), float(edges[k + 1]), ratio, part))
    return found
