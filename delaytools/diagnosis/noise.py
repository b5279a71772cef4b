"""What of a residual is noise: its spectrum where no input explains it, and the filter that makes it white."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.ndimage import median_filter
from scipy.signal import lfilter

__all__ = [
    "Whitening",
    "autoregression",
    "incoherent_spectrum",
    "whitening",
    "wiener_part",
    "windowed_spectra",
    "without_odd_rows",
]

Array = NDArray[np.float64]
WINDOW = 1024  # rows of one piece of the averaged spectra
AT_END = 13  # rows by which the end of a series is known
ORDER = 12  # of the prediction-error filter
MOST, BELOW = 0.95, 1.96  # share of |x| that lies below, x normal with standard deviation 1
RESOLVED = 3e-5  # of a signal's rms: differences below it are the simulation's or the log's rounding
RESOLVED_HELD = 1e-4
LARGEST, FEW_ODD = 6.0, 0.005  # standard deviations beyond which no noise goes, and a share of rows that counts as few


@final
@dataclass(frozen=True, eq=False)
class Whitening:
    """A prediction-error filter: e = lfilter(taps, 1, r) is white with standard deviation 1 where r is the noise.

    rms: of the noise in the signal's unit. frequency (k,) in cycles per row and density (k,): its two-sided
    spectrum, mean over frequency = rms².
    """

    taps: Array
    rms: float
    frequency: Array
    density: Array

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """(count,) noise of this spectrum."""
        return np.asarray(lfilter([1.0], self.taps, generator.standard_normal(count)))

    def evenly(self) -> "Whitening":
        """A filter of one tap, at the highest density: where the noise is coloured, χ² counts no more than it should.

        What a slow effect changes is judged against slow noise; n rows count as n mean(density)/max(density).
        """
        level = float(np.sqrt(self.density.max()))
        return Whitening(np.array([1 / level]), self.rms, self.frequency, self.density)

    def apply(self, rows: Array) -> Array:
        """Whitened rows; rows (n,) or (n, k), filtered along the first axis."""
        return np.asarray(lfilter(self.taps, [1.0], rows, axis=0))


def windowed_spectra(rows: Array, window: int) -> Array:
    """(pieces, k, bins): windowed Fourier transforms of overlapping pieces of rows (n, k)."""
    count = max(1, (len(rows) - window) // (window // 2) + 1)
    taper = np.hanning(window)[:, None]
    taper = taper / np.sqrt(np.mean(taper**2) * window)
    starts = [k * (window // 2) for k in range(count)]
    parts = [
        np.fft.rfft((rows[s : s + window] - rows[s : s + window].mean(0)) * taper, axis=0) for s in starts
    ]
    return np.moveaxis(np.stack(parts), 1, 2)


def incoherent_spectrum(residual: Array, inputs: Array) -> tuple[Array, Array]:
    """Frequency (cycles per row) and density of the part of a residual (n,) that no input (n, k) explains linearly.

    Welch's average of the least-squares remainder at each frequency, raised by its lost degrees of freedom, then
    the median over neighbours, which leaves lines out (they are no noise). Bendat & Piersol 2010, section 7.3.
    """
    window = min(WINDOW, max(16, 2 ** int(np.log2(max(len(residual) // 12, 16)))))
    spread = inputs.std(axis=0)
    useful = inputs[:, spread > 1e-12 * (1e-300 + np.abs(inputs).max(initial=0.0))]
    scaled = useful / np.maximum(useful.std(axis=0), 1e-300)
    r = windowed_spectra(residual[:, None], window)[:, 0]
    pieces = len(r)
    most = max(0, (pieces - 1) // 4)
    x = (
        windowed_spectra(scaled[:, :most], window)
        if scaled[:, :most].size
        else np.zeros((pieces, 0, r.shape[1]))
    )
    left = np.einsum("pkf,plf->fkl", x.conj(), x)
    right = np.einsum("pkf,pf->fk", x.conj(), r)
    left += 1e-9 * np.eye(x.shape[1]) * (1e-300 + np.einsum("fkk->f", left).real[:, None, None])
    weights = np.linalg.solve(left, right[..., None])[..., 0] if x.shape[1] else np.zeros((r.shape[1], 0))
    remainder = r - np.einsum("pkf,fk->pf", x, weights)
    density = np.sum(np.abs(remainder) ** 2, axis=0) / max(pieces - x.shape[1], 1)
    density[:2] = density[2]
    smooth = median_filter(density, size=9, mode="nearest")
    return np.fft.rfftfreq(window), np.maximum(smooth, 1e-300)


def autoregression(residuals: Sequence[Array]) -> Whitening:
    """The prediction-error filter of residuals (n,) of several logs that are noise in all, slow drift included.

    By least squares; the density is that of the longest.
    """
    longest = max(residuals, key=len)
    order = min(ORDER, min(map(len, residuals)) // 4)
    windows = [np.flip(np.lib.stride_tricks.sliding_window_view(r[:-1], order), axis=1) for r in residuals]
    next_rows = np.concatenate([r[order:] for r in residuals])
    error = np.concatenate([[1.0], -np.linalg.lstsq(np.concatenate(windows), next_rows, rcond=1e-12)[0]])
    left = float(np.sqrt(np.mean(np.concatenate([lfilter(error, [1.0], r) for r in residuals]) ** 2)))
    density = np.abs(np.fft.rfft(longest)) ** 2 / len(longest)
    size = float(np.std(np.concatenate(residuals)))
    return Whitening(error / max(left, 1e-150), size, np.fft.rfftfreq(len(longest)), density)


def whitening(frequency: Array, density: Array) -> Whitening:
    """The prediction-error filter of a spectrum, by the Yule–Walker equations."""
    covariance = np.fft.irfft(density)
    covariance[0] *= 1 + 1e-9
    order = min(ORDER, len(covariance) // 4)
    ahead = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
    variance = max(float(covariance[0] - ahead @ covariance[1 : order + 1]), 1e-12 * float(covariance[0]))
    taps = np.concatenate([[1.0], -ahead]) / np.sqrt(variance)
    return Whitening(taps, float(np.sqrt(covariance[0])), frequency, density)


def wiener_part(remainder: Array, noise: float | Whitening, *, clearly: float = 3.0) -> Array:
    """What of a remainder (n,) stands clearly above the noise (white, or of a known spectrum), by a zero-phase
    Wiener filter; the remainder goes on beyond its ends by its image in each."""
    frequency, density = incoherent_spectrum(remainder, np.zeros((len(remainder), 0)))
    if isinstance(noise, Whitening):
        floor = np.interp(frequency, noise.frequency, noise.density)
    else:
        floor = np.full(len(frequency), noise**2)
    share = np.where(density > clearly * floor, 1 - floor / density, 0.0)
    images = [2 * _at_the_end(rows) - rows[: 2 * WINDOW][:0:-1] for rows in (remainder, remainder[::-1])]
    whole = np.concatenate([images[0], remainder, images[1][::-1]])
    full = np.fft.rfftfreq(len(whole))
    passed = np.fft.irfft(np.fft.rfft(whole) * np.interp(full, frequency, share), len(whole))
    return np.asarray(passed[len(images[0]) : len(images[0]) + len(remainder)])


def _at_the_end(rows: Array) -> float:
    """The first of these rows (n,) without its noise: by a line through those beside it."""
    near = rows[:AT_END]
    return float(np.polynomial.polynomial.polyfit(np.arange(len(near)), near, min(1, len(near) - 1))[0])


def without_odd_rows(rows: Array, *, least: float = 0.0) -> Array:
    """A residual (n,), rows larger than the noise of most of them cut to the largest that noise would be, where few.

    least: standard deviation that the noise is known to have.
    """
    size = np.abs(rows)
    level = LARGEST * max(float(np.quantile(size, MOST)) / BELOW, least)  # not by the median: much may be at rest
    return np.clip(rows, -level, level) if (size > level).mean() < FEW_ODD else rows
