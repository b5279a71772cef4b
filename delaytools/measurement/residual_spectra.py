"""Residuals in frequency: averaged spectra, against what noise explains, and coherent with what drives the loop."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

__all__ = ["Spectra", "bands", "holm", "spectra", "windowed"]

Array = NDArray[np.float64]
WINDOW = 1024  # rows of one piece
FEWEST = 4.0  # pieces for a coherence
OVERLAP = 0.9  # half-overlapping Hann pieces count for this much of as many independent ones
LEVEL = 1.15  # in power: how well a noise level without a model is known


@final
@dataclass(frozen=True, eq=False)
class Spectra:
    """frequency (k,) Hz; error, noise (k,): densities whose sum over k is the mean square.

    coherence (k,): largest squared coherence with a reference. p_level, p_coherence (k,): chance of so much under noise
    alone. pieces: independent pieces averaged.
    """

    frequency: Array
    error: Array
    noise: Array
    coherence: Array
    p_coherence: Array
    pieces: float
    carried: bool

    def level_chance(self, which: slice) -> float:
        """Chance that noise alone is as strong in these bins as the error is, its level known to 15 %."""
        ratio = float(self.error[which].sum() / max(self.noise[which].sum(), 1e-300)) / LEVEL
        degrees = 2 * self.pieces * (which.stop - which.start)
        return float(f_distribution.sf(ratio, degrees, degrees if self.carried else 1e6))


def windowed(rows: Array, window: int) -> NDArray[np.complex128]:
    """(pieces, bins): half-overlapping Hann pieces of rows (n,); Σ over bins of |·|² is the mean square."""
    taper = np.hanning(window + 1)[:-1]
    taper = taper / np.sqrt(np.sum(taper**2))
    starts = range(0, len(rows) - window + 1, max(window // 2, 1))
    if not starts:
        return np.zeros((0, window // 2 + 1), dtype=complex)
    found = np.fft.rfft(np.stack([rows[s : s + window] * taper for s in starts]), axis=1)
    found[:, 1 : (window + 1) // 2] *= np.sqrt(2.0)
    return np.asarray(found / np.sqrt(window), dtype=complex)


def spectra(
    step: float,
    errors: Sequence[Array],
    carried: Sequence[Array],
    references: Sequence[Sequence[Array]],
    white: float,
) -> Spectra:
    """Averaged over logs on even rows, `step` s apart.

    errors, carried: per log (n,), measured minus model and the part of it that the inputs' noise is expected to be.
    references: per reference, per log (n,). white: standard deviation of the exit's own white noise.
    """  # fmt: skip
    window = _window([len(rows) for rows in errors])
    e = np.concatenate([windowed(rows, window) for rows in errors])
    c = np.concatenate([windowed(rows, window) for rows in carried])
    pieces = max(1.0, OVERLAP * len(e)) if len(e) > 1 else 1.0
    power = np.mean(np.abs(e) ** 2, axis=0)
    flat = np.full(len(power), 2.0)
    flat[0] = 1.0
    if window % 2 == 0:
        flat[-1] = 1.0
    noise = white**2 * flat / window + np.mean(np.abs(c) ** 2, axis=0)
    gamma, chance = np.zeros(len(power)), np.ones(len(power))
    for logs in references if pieces >= FEWEST else ():
        u = np.concatenate([windowed(rows, window) for rows in logs])
        size = np.mean(np.abs(u) ** 2, axis=0)
        seen = size > 1e-12 * size.sum()
        cross = np.abs(np.mean(e * u.conj(), axis=0)) ** 2
        one = np.where(seen, cross / np.maximum(power * size, 1e-300), 0.0)
        gamma, chance = np.maximum(gamma, one), np.minimum(chance, np.clip(1 - one, 0, 1) ** (pieces - 1))
    chance = np.minimum(1.0, chance * max(1, len(references)))
    frequency = np.asarray(np.fft.rfftfreq(window, step), dtype=np.float64)
    return Spectra(frequency, power, noise, gamma, chance, pieces, bool(np.any(np.abs(c) > 0)))


def _window(lengths: Sequence[int]) -> int:
    """Rows of a piece: 1024, or less where logs are shorter than a dozen of them, or the usual one than that.

    Logs that are shorter still are left out.
    """
    wanted = max(16, min(WINDOW, 2 ** int(np.log2(max(sum(lengths) // 12, 16)))))
    return min(wanted, int(np.median(lengths)))


def bands(frequency: Array, parts: int = 24) -> list[slice]:
    """Bins in groups of about equal ratio from the first to the last frequency; bin 0 alone."""
    edges = np.geomspace(frequency[1], frequency[-1], parts + 1) if len(frequency) > 2 else frequency
    places = np.unique(np.r_[1, np.searchsorted(frequency, edges[1:-1]), len(frequency)])
    return [slice(0, 1), *(slice(int(a), int(b)) for a, b in pairwise(places))]


def holm(chances: Array, level: float) -> NDArray[np.bool_]:
    """Which of these chances are significant together at `level` (Holm 1979)."""
    order = np.argsort(chances)
    count = len(chances)
    bounds = level / (count - np.arange(count))
    failed = np.flatnonzero(chances[order] > bounds)
    kept = np.zeros(count, dtype=bool)
    kept[order[: failed[0] if len(failed) else count]] = True
    return kept
