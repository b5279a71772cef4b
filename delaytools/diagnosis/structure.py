"""Whether a residual still hangs together with the past of what drives the segment, and in which bands."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

__all__ = ["Band", "octaves", "structured_bands"]

Array = NDArray[np.float64]
LAGS = (1, 2, 3, 5, 9, 17, 33, 65)  # not 0: a controller that acts at once hands this row's noise on


@final
@dataclass(frozen=True)
class Band:
    """A band (cycles per row) in which the past of the inputs explains part of a whitened residual.

    share: power explained beyond chance and what the inputs' noise may do, in units of white noise of
    standard deviation 1. probability: of as much by chance.
    """

    low: float
    high: float
    share: float
    probability: float


def structured_bands(residual: Array, inputs: Array, sent: Array | None = None) -> tuple[Band, ...]:
    """Every octave band with what the inputs (n, k) explain of a white residual (n,), beyond what chance explains.

    Least squares on past inputs only: where the residual's own noise goes round the loop it shows in later
    inputs, and any non-causal coherence would take that for a missing effect (Ljung 1999, section 13.4).
    sent: (n,) what noise left in the inputs may do, whitened as well: it goes with them, and as much is no structure.
    """
    basis = _past(inputs)
    weights = basis.T @ residual
    explained = np.abs(np.fft.rfft(basis @ weights)) ** 2
    chance = (np.abs(np.fft.rfft(basis, axis=0)) ** 2).astype(float)
    level = float(np.mean(residual**2)) if len(residual) else 1.0
    allowed = np.zeros(len(explained)) if sent is None else np.abs(np.fft.rfft(sent)) ** 2
    return _by_octave(explained, chance, allowed, (min(max(level, 0.0), 1.0), len(residual)))


def _past(inputs: Array) -> Array:
    """(n, m) orthonormal: the inputs some rows ago."""
    spread = inputs.std(axis=0)
    useful = inputs[:, spread > 1e-12] / spread[spread > 1e-12]
    columns = [np.ones(len(inputs))]
    for lag in (lag for lag in LAGS if lag < len(inputs)):
        for u in useful.T:
            columns.append(np.concatenate([np.full(lag, u[0]), u[: len(u) - lag]]))
    stacked = np.stack(columns, axis=1)
    left, sizes, _ = np.linalg.svd(stacked.T @ stacked)
    kept = sizes > 1e-9 * sizes[0]
    return np.asarray(stacked @ (left[:, kept] / np.sqrt(sizes[kept])))


def _by_octave(explained: Array, chance: Array, allowed: Array, size: tuple[float, int]) -> tuple[Band, ...]:
    (level, rows), found = size, []
    for edge, last in octaves(len(explained), rows):
        up = float(explained[edge:last].sum()) * 2 / rows
        expected = chance[edge:last].sum(axis=0) * 2 / rows * level
        mean, square = float(expected.sum()), float((expected**2).sum())
        freedom = mean**2 / max(square, 1e-300)
        probability = float(chi2.sf(up / max(mean, 1e-300) * freedom, freedom))
        sent = float(allowed[edge:last].sum()) * 2 / rows
        share = max(up - mean - sent, 0.0) / max(2 * (last - edge), 1)
        found.append(
            Band(edge / rows, (last if last < len(explained) else rows // 2) / rows, share, probability)
        )
    return tuple(found)


def octaves(lines: int, rows: int) -> list[tuple[int, int]]:
    """(first, last + 1) of the spectral lines of every octave; rows: of the series."""
    found, edge = [], max(2, rows // 10000)
    while edge < lines - 1:
        found.append((edge, min(2 * edge, lines)))
        edge = found[-1][1]
    return found
