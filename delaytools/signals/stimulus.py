"""What drives an external input: step, pulse, doublet, sine, chirp, multisine, noise, formula, a log's column."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError, shown

__all__ = [
    "Chirp",
    "Column",
    "Doublet",
    "Formula",
    "Multisine",
    "Noise",
    "Pulse",
    "Sine",
    "Step",
    "Stimulus",
    "Zero",
    "jumping",
]

Array = NDArray[np.float64]
NEAREST, JUMP = 3, 6.0  # slopes on either side, and how many times the largest of them a jump is
ROUNDING = 1e-6  # of the largest slope: smaller ones are none
JUST_BEFORE = -1e-9  # s: here a signal has the value that it keeps before t = 0


class Stimulus(ABC):
    """A signal given as a function of time; before t = 0 it keeps the value it has just before."""

    @abstractmethod
    def value(self, t: Array) -> Array:
        """Values at the times t (s), continuous from the right."""

    @property
    @abstractmethod
    def jumps(self) -> tuple[float, ...]:
        """Times (s) at which the value jumps."""

    def late(self, seconds: float) -> "Stimulus":
        """The same signal so many seconds later, and until then what it was before t = 0."""
        return _Late(self, seconds)


@final
@dataclass(frozen=True)
class _Late(Stimulus):
    """A signal some seconds later."""

    original: Stimulus
    seconds: float

    @property
    def jumps(self) -> tuple[float, ...]:
        return tuple(t + self.seconds for t in self.original.jumps)

    def value(self, t: Array) -> Array:
        return self.original.value(np.maximum(t - self.seconds, JUST_BEFORE))


@final
@dataclass(frozen=True)
class Zero(Stimulus):
    """Nothing."""

    jumps = ()

    def value(self, t: Array) -> Array:
        return np.zeros_like(t)


@final
@dataclass(frozen=True)
class Constant(Stimulus):
    """One value at all times."""

    level: float

    jumps = ()

    def value(self, t: Array) -> Array:
        return np.full(np.shape(t), self.level)


@final
@dataclass(frozen=True, kw_only=True)
class Step(Stimulus):
    """amplitude from `start` on."""

    amplitude: float
    start: float = 0.0

    @property
    def jumps(self) -> tuple[float, ...]:
        return (self.start,)

    def value(self, t: Array) -> Array:
        return self.amplitude * np.asarray(t >= self.start, dtype=np.float64)


@final
@dataclass(frozen=True, kw_only=True)
class Pulse(Stimulus):
    """amplitude between `start` and `start + width`."""

    amplitude: float
    start: float = 0.0
    width: float

    @property
    def jumps(self) -> tuple[float, ...]:
        return self.start, _instant(self.start + self.width)

    def value(self, t: Array) -> Array:
        start, end = self.jumps
        return self.amplitude * np.asarray((t >= start) & (t < end), dtype=np.float64)


@final
@dataclass(frozen=True, kw_only=True)
class Doublet(Stimulus):
    """amplitude for `width`, then -amplitude for `width`."""

    amplitude: float
    start: float = 0.0
    width: float

    @property
    def jumps(self) -> tuple[float, ...]:
        return self.start, _instant(self.start + self.width), _instant(self.start + 2 * self.width)

    def value(self, t: Array) -> Array:
        start, middle, end = self.jumps
        first, second = (t >= start) & (t < middle), (t >= middle) & (t < end)
        return self.amplitude * (first.astype(float) - second)


def _instant(t: float) -> float:
    """A time (s) without the rounding of a sum: 0.1 + 2·0.1 is 0.3."""
    return round(t, 12)


@final
@dataclass(frozen=True, kw_only=True)
class Sine(Stimulus):
    """amplitude sin(2π frequency (t - start) + phase) from `start` on; frequency in Hz, phase in rad."""

    amplitude: float
    frequency: float
    phase: float = 0.0
    start: float = 0.0

    @property
    def jumps(self) -> tuple[float, ...]:
        return (self.start,) if self.start > 0 or math.sin(self.phase) != 0 else ()

    def value(self, t: Array) -> Array:
        wave = np.sin(2 * math.pi * self.frequency * (t - self.start) + self.phase)
        return self.amplitude * wave * (t >= self.start)


@final
@dataclass(frozen=True, kw_only=True)
class Chirp(Stimulus):
    """A sine whose frequency goes from `from_frequency` to `to_frequency` (Hz) in `duration` s, exponentially."""

    amplitude: float
    from_frequency: float
    to_frequency: float
    duration: float
    start: float = 0.0

    @property
    def jumps(self) -> tuple[float, ...]:
        return self.start, self.start + self.duration

    def value(self, t: Array) -> Array:
        after = np.clip(t - self.start, 0.0, self.duration)
        ratio = math.log(self.to_frequency / self.from_frequency) / self.duration
        cycles = self.from_frequency * (np.expm1(ratio * after) / ratio if ratio else after)
        inside = (t >= self.start) & (t < self.start + self.duration)
        return self.amplitude * np.sin(2 * math.pi * cycles) * inside


@final
@dataclass(frozen=True, kw_only=True)
class Multisine(Stimulus):
    """amplitude √(2/n) Σ sin(2π f_k t + φ_k): equal lines from `from_frequency` to `to_frequency` Hz, Schroeder phases.

    rms value: `amplitude`. Phases: φ_k = -π k (k - 1) / n (Schroeder 1970).
    """

    amplitude: float
    from_frequency: float
    to_frequency: float
    lines: int = 32

    jumps = ()

    def value(self, t: Array) -> Array:
        k = np.arange(1, self.lines + 1)
        frequency = np.linspace(self.from_frequency, self.to_frequency, self.lines)
        phase = -math.pi * k * (k - 1) / self.lines
        total = sum(np.sin(2 * math.pi * f * t + p) for f, p in zip(frequency, phase, strict=True))
        return self.amplitude * math.sqrt(2 / self.lines) * np.asarray(total)


@final
@dataclass(frozen=True, kw_only=True)
class Noise(Stimulus):
    """White Gaussian numbers of standard deviation `rms`, one every `period` s, joined by straight lines."""

    rms: float
    period: float = 1e-3
    seed: int = 1

    jumps = ()

    def value(self, t: Array) -> Array:
        place = np.maximum(t, 0.0) / self.period
        drawn = self.rms * np.random.default_rng(self.seed).standard_normal(
            int(np.ceil(place.max(initial=0))) + 2
        )
        return np.interp(place, np.arange(len(drawn)), drawn)


@final
@dataclass(frozen=True, kw_only=True)
class Formula(Stimulus):
    """Any formula of t (s) and of named numbers; raises DesignError for other names and where it has no value."""

    formula: Expression
    values: Mapping[str, float] = field(default_factory=dict)

    jumps = ()

    def __post_init__(self) -> None:
        odd = [name for name in self.formula.names if name != "t" and name not in self.values]
        if odd:
            known = ["t", "pi", *self.values]
            raise DesignError("unknown name in the formula of an input", found=repr(odd[0]), known=known)

    def value(self, t: Array) -> Array:
        with np.errstate(all="ignore"):
            found = np.asarray(self.formula.evaluate({**self.values, "t": t}), dtype=float)
        found = np.broadcast_to(found, t.shape)
        if not np.isfinite(found).all():
            when = float(t[~np.isfinite(found)][0])
            raise DesignError(
                "the formula of an input has no finite value",
                found=f"{shown(self.formula.text)} at t = {when:g} s",
            )
        return found


def jumping(slopes: Array) -> NDArray[np.bool_]:
    """Which slopes from row to row (n,) are jumps: far larger than any of the nearest on either side."""
    around = np.pad(np.abs(slopes), NEAREST)
    beside = [k for k in range(2 * NEAREST + 1) if k != NEAREST]
    largest = np.stack([around[k : k + len(slopes)] for k in beside]).max(axis=0)
    return np.asarray(np.abs(slopes) > JUMP * largest + ROUNDING * np.abs(slopes).max(initial=0.0))


@final
@dataclass(frozen=True, kw_only=True)
class Column(Stimulus):
    """Values at given times, joined by straight lines, held until the next row, or joined smoothly by a cubic spline.

    before: the value before the first row (default: the first value). Straight lines take (ωh)²/12 off a sine of
    ω rad/s sampled every h s; a spline takes (ωh)⁴/720, but makes more of noise. It ends before a jump and begins anew
    behind it, a straight line between them: as if the jump were half way between its rows.
    """

    time: Array
    values: Array
    held: bool = False
    before: float | None = None
    smooth: bool = False

    def late(self, seconds: float) -> "Column":
        return replace(self, time=self.time + seconds)

    @cached_property
    def _spline(self) -> PPoly:
        slope = np.diff(self.values) / np.diff(self.time)
        slopes = np.stack([np.zeros_like(slope), np.zeros_like(slope), slope, self.values[:-1]])
        first = 0
        for last in (*np.flatnonzero(jumping(slope)), len(slope)):
            if last > first:
                piece = slice(first, last + 1)
                slopes[:, first:last] = CubicSpline(self.time[piece], self.values[piece]).c
            first = last + 1
        return PPoly(slopes, self.time)

    @property
    def jumps(self) -> tuple[float, ...]:
        """Also where the first row comes later than t = 0: there the value begins to move."""
        begins = self.before not in (None, self.values[0]) or self.time[0] > 0
        first = self.time[:1] if begins else self.time[:0]
        if not self.held:
            return tuple(first)
        changed = np.flatnonzero(np.diff(self.values)) + 1
        return (*first, *self.time[changed])

    def value(self, t: Array) -> Array:
        if self.held:
            index = np.searchsorted(self.time, t, side="right") - 1
            found = self.values[np.clip(index, 0, len(self.values) - 1)]
        elif self.smooth:
            found = self._spline(np.clip(t, self.time[0], self.time[-1]))
        else:
            found = np.interp(t, self.time, self.values)
        return found if self.before is None else np.where(t < self.time[0], self.before, found)
