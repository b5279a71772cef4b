"""Delays that swing about a mean: sought in the spectrum at every port, where the mean itself may be imitated."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.places import Spot
from delaytools.diagnosis.screen import STRETCH, Base, Screened, response
from delaytools.diagnosis.spectra import highest_lines
from delaytools.diagnosis.wires import Way, change_at, own_way
from delaytools.loop.port import Port

__all__ = ["swings", "with_swing"]

Array = NDArray[np.float64]
LATENESS = (0.5, 2.0, 8.0, 30.0)  # rows by which the signal is shifted to take its slope
SLOWEST, FASTEST = 0.25, 10.0  # turns in the log, and Hz
PADDING = 4
LINES = 2  # highest lines tried at a port and a shift
LEAST, PART = 100.0, 0.3  # χ² that a swing must take off beyond the mean delay, and of what that leaves


def swings(base: Base, spots: Sequence[Spot]) -> list[Screened]:
    """The delay with the best swing at every port for delays whose way to the exits is linear."""
    found = []
    for spot in (s for s in spots if s.kind == "delay"):
        way = base.way(str(spot.port))
        if way is not None and way.is_quick and (best := _best(base, way, spot.port)) is not None:
            found.append(best)
    return found


def _best(base: Base, way: Way, port: Port) -> Screened | None:
    """The mean and the swing that take most off together, where the swing is worth it beside the mean."""
    step = base.case.step
    best: tuple[float, Added] | None = None
    for rows in LATENESS:
        late = Added("delay", str(port), {"delay": rows * step})
        element = own_way(base.view, late)
        changes = None if element is None else change_at(base.view, port, element)
        if changes is None:
            continue
        slopes = tuple(change / (rows * step) for change in changes)
        moved = way.convolved(slopes)
        if moved is None:
            return None
        mean = base.projected(base.case.whitened(moved))
        power = float(mean @ mean)
        left = base.residual - mean * (float(mean @ base.residual) / power if power > 0 else 0.0)
        for frequency in _frequencies(way, way.weights(left), slopes, step):
            gain, values = _fitted(base, way, (mean, left), slopes, frequency)
            if values is not None and (best is None or gain > best[0]):
                best = gain, with_swing(str(port), values)
    if best is None:
        return None
    change = response(base, best[1])
    gain = 0.0 if change is None else base.gain(change, *STRETCH)[0]
    return Screened(best[1], max(gain, 0.5 * best[0]))


def with_swing(at: str, values: dict[str, float]) -> Added:
    """The varying delay, with the limits within which a fit may look for its frequency and phase."""
    frequency = values["frequency"]
    limits = {"phase": (-10.0, 10.0), "frequency": (0.5 * frequency, 2 * frequency)}
    return Added("variable_delay", at, values, {}, frozenset(), limits)


def _frequencies(way: Way, weights: tuple[Array, ...], slopes: tuple[Array, ...], step: float) -> list[float]:
    """The frequencies (Hz) at which a swing promises most.

    Along the residual a swing moves the exits by the transform of weights times slope; its own χ² is the spectrum of
    the slope, shifted by the swing's frequency, seen through the way: one correlation gives it for all frequencies.
    """
    longest = max(map(len, slopes))
    size = 1 << (PADDING * longest - 1).bit_length()
    frequency = np.fft.rfftfreq(size, step)
    along, power = np.zeros(len(frequency)), np.zeros(len(frequency))
    for weight, slope, through in zip(weights, slopes, way.gains, strict=True):
        along += np.abs(np.fft.rfft(weight * slope, size)) ** 2
        own = np.abs(np.fft.fft(way.read(slope), len(slope))) ** 2 / len(slope)
        both = np.concatenate([through, through[1 : len(slope) - len(through) + 1][::-1]])
        shifted = np.fft.irfft(np.fft.rfft(own).conj() * np.fft.rfft(both), len(slope))
        power += np.interp(frequency, np.arange(len(slope)) / (len(slope) * step), np.maximum(shifted, 0.0))
    within = (frequency >= SLOWEST / (longest * step)) & (frequency <= min(FASTEST, 0.05 / step))
    gain = np.where(within & (power > 1e-9 * power.max(initial=0.0)), 2 * along / np.maximum(power, 1e-300), 0.0)
    return [float(frequency[k]) for k in highest_lines(gain, LINES, apart=PADDING)]


def _fitted(
    base: Base, way: Way, seen: tuple[Array, Array], slopes: tuple[Array, ...], frequency: float
) -> tuple[float, dict[str, float] | None]:
    """χ² that mean and swing take off together, and their values; None where the mean alone does nearly as well.

    seen: what the mean does, projected, and the residual that it leaves.
    """
    mean, left = seen
    columns = [mean]
    for shape in (np.sin, np.cos):
        turns = (2 * math.pi * frequency * (r.time - r.time[0]) for r in base.case.records)
        moved = way.convolved(tuple(slope * shape(turn) for slope, turn in zip(slopes, turns, strict=True)))
        if moved is None:
            return 0.0, None
        columns.append(base.projected(base.case.whitened(moved)))
    matrix = np.stack(columns, axis=1)
    square, right = matrix.T @ matrix, matrix.T @ base.residual
    if not np.isfinite(square).all() or not np.isfinite(right).all():
        return 0.0, None
    weights = np.linalg.lstsq(square, right, rcond=1e-9)[0]
    gain, rest = float(weights @ right), float(left @ left)
    alone = float(base.residual @ base.residual) - rest
    swing = float(np.hypot(weights[1], weights[2]))
    if gain - alone < max(LEAST, PART * rest) or swing <= 0:
        return gain, None
    phase = float(np.arctan2(weights[2], weights[1]))
    return gain, {"mean": max(float(weights[0]), swing), "amplitude": swing, "frequency": frequency, "phase": phase}
