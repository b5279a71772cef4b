"""Delays that swing about a mean: sought in the spectrum at every port, where the mean itself may be imitated."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.places import Spot
from delaytools.diagnosis.screen import STRETCH, Base, Screened, response
from delaytools.diagnosis.spectra import highest_lines
from delaytools.diagnosis.wire_changes import change_at
from delaytools.diagnosis.wires import Way, own_way
from delaytools.loop.port import Port

__all__ = ["swings", "with_swing"]

Array = NDArray[np.float64]
LATENESS = (0.5, 2.0, 8.0, 30.0)  # rows by which the signal is shifted to take its slope
SLOWEST, FASTEST = 0.25, 10.0  # turns in the log, and Hz
PADDING = 4
LINES = 2  # highest lines tried at a port and a shift
ALIKE, APART = 2.0, 0.2  # times what the best one leaves, and in log of frequency: another swing that may be the one
LEAST, PART = 40.0, 0.3  # χ² that a swing must take off beyond the mean delay, and of what that leaves beyond noise


def swings(base: Base, spots: Sequence[Spot]) -> list[Screened]:
    """The delay with the best swings at every port for delays whose way to the exits is linear."""
    found = []
    for spot in (s for s in spots if s.kind == "delay"):
        way = base.way(str(spot.port))
        if way is not None and way.is_quick:
            found += [_screened(base, str(spot.port), *one) for one in _best(base, way, spot.port)]
    return found


def _screened(base: Base, at: str, gain: float, values: dict[str, float]) -> Screened:
    one = with_swing(at, values)
    change = response(base, one)
    exactly = 0.0 if change is None else base.gain(change, *STRETCH)[0]
    return Screened(one, max(exactly, 0.5 * gain))


def _best(base: Base, way: Way, port: Port) -> list[tuple[float, dict[str, float]]]:
    """χ² and values of the mean and the swing that take most off together, where the swing is worth it beside the mean.

    One that takes most off is one of many that cause the same slow drift: the spectrum knows nothing of what free
    values can do, so all frequencies are tried then, and those that leave nearly as little are as likely.
    """
    found: list[tuple[float, dict[str, float]]] = []
    for rows in LATENESS:
        seen = _slopes(base, way, port, rows)
        if seen is None:
            continue
        found += _worth(base, way, seen, _frequencies(way, way.weights(seen.left), seen.slopes, base.case.step))
    best, total = max((gain for gain, _ in found), default=0.0), float(base.residual @ base.residual)
    seen = _slopes(base, way, port, LATENESS[1])
    if seen is None or best < 0.5 * total:
        return sorted(found, key=lambda one: -one[0])[:1]
    found += _worth(base, way, seen, np.arange(SLOWEST, FASTEST * base.case.duration, 0.5) / base.case.duration)
    kept: list[tuple[float, dict[str, float]]] = []
    for gain, values in sorted(found, key=lambda one: -one[0]):
        near = not kept or total - gain < ALIKE * (total - kept[0][0])
        if near and all(abs(np.log(values["frequency"] / one["frequency"])) > APART for _, one in kept):
            kept.append((gain, values))
    return kept[: LINES + 1]


@final
@dataclass(frozen=True, eq=False)
class _Slopes:
    """What a second of delay changes at a port, per log (n,); mean: (rows,) what that does to the exits, projected, and
    the residual left when it is taken off."""

    slopes: tuple[Array, ...]
    mean: Array
    left: Array


def _slopes(base: Base, way: Way, port: Port, rows: float) -> _Slopes | None:
    """By a delay of so many rows; None where the port has no rule for that."""
    delay = rows * base.case.step
    element = own_way(base.view, Added("delay", str(port), {"delay": delay}))
    changes = None if element is None else change_at(base.view, port, element)
    slopes = None if changes is None else tuple(change / delay for change in changes)
    moved = None if slopes is None else way.convolved(slopes)
    if slopes is None or moved is None:
        return None
    mean = base.projected(base.case.whitened(moved))
    power = float(mean @ mean)
    return _Slopes(slopes, mean, base.residual - mean * (float(mean @ base.residual) / power if power > 0 else 0.0))


def _worth(
    base: Base, way: Way, seen: _Slopes, frequencies: Iterable[float]
) -> list[tuple[float, dict[str, float]]]:
    """χ² and values of the swings at these frequencies (Hz) that are worth it."""
    found = (_fitted(base, way, seen, float(frequency)) for frequency in frequencies)
    return [(gain, values) for gain, values in found if values is not None]


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
    base: Base, way: Way, seen: _Slopes, frequency: float
) -> tuple[float, dict[str, float] | None]:
    """χ² that mean and swing take off together, and their values; None where the mean alone does nearly as well."""
    columns = [seen.mean]
    for shape in (np.sin, np.cos):
        turns = (2 * math.pi * frequency * (r.time - r.time[0]) for r in base.case.records)
        moved = way.convolved(tuple(slope * shape(turn) for slope, turn in zip(seen.slopes, turns, strict=True)))
        if moved is None:
            return 0.0, None
        columns.append(base.projected(base.case.whitened(moved)))
    matrix = np.stack(columns, axis=1)
    square, right = matrix.T @ matrix, matrix.T @ base.residual
    if not np.isfinite(square).all() or not np.isfinite(right).all():
        return 0.0, None
    weights = np.linalg.lstsq(square, right, rcond=1e-9)[0]
    gain, rest = float(weights @ right), float(seen.left @ seen.left)
    alone = float(base.residual @ base.residual) - rest
    swing = float(np.hypot(weights[1], weights[2]))
    if gain - alone < max(LEAST, PART * max(rest - len(base.residual), 0.0)) or swing <= 0:
        return gain, None
    phase = float(np.arctan2(weights[2], weights[1]))
    return gain, {"mean": max(float(weights[0]), swing), "amplitude": swing, "frequency": frequency, "phase": phase}
