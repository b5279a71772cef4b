"""A logged signal as a curve over continuous time, averaged over a short window, and its slope."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.signals.record import Record

__all__ = ["Curve", "curve_of", "slope", "value"]

Array = NDArray[np.float64]


@final
@dataclass(frozen=True)
class Curve:
    """The mean of a signal over [t - width/2, t + width/2]; between rows it is held, or linear.

    time: (n,) s. values, rates, areas: (n,) the signal, its slope after each row, its integral up to each row.
    """

    time: Array
    values: Array
    rates: Array
    areas: Array
    width: float

    @property
    def start(self) -> float:
        """The first time, s, at which the mean is known."""
        return float(self.time[0]) + self.width / 2

    @property
    def end(self) -> float:
        """The last time, s, at which the mean is known."""
        return float(self.time[-1]) - self.width / 2


def curve_of(record: Record, name: str, width: float) -> Curve:
    """The curve of a signal, less its mean and divided by its standard deviation."""
    values = record[name] - np.mean(record[name])
    values = values / np.std(values)
    steps = np.diff(record.time)
    rates = np.zeros_like(steps) if name in record.held else np.diff(values) / steps
    areas = np.append(0.0, np.cumsum(values[:-1] * steps + rates * steps**2 / 2))
    return Curve(record.time, values, np.append(rates, 0.0), areas, width)


def value(curve: Curve, time: Array) -> Array:
    """The mean over the window about each time (s)."""
    half = curve.width / 2
    return (_area(curve, time + half) - _area(curve, time - half)) / curve.width


def slope(curve: Curve, time: Array) -> Array:
    """The derivative of the mean, per s."""
    half = curve.width / 2
    return (_point(curve, time + half) - _point(curve, time - half)) / curve.width


def _row(curve: Curve, time: Array) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(curve.time, time, side="right") - 1, 0, len(curve.time) - 1)


def _area(curve: Curve, time: Array) -> Array:
    row = _row(curve, time)
    past = time - curve.time[row]
    return curve.areas[row] + past * (curve.values[row] + past * curve.rates[row] / 2)


def _point(curve: Curve, time: Array) -> Array:
    row = _row(curve, time)
    return curve.values[row] + (time - curve.time[row]) * curve.rates[row]
