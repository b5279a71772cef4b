"""What is wished of a design: goals as records, each with its own formula."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import casadi as ca

from delaytools.analysis.margins import Margins
from delaytools.blocks.block import Scalar

__all__ = ["BandError", "GainMargin", "Goal", "MarginGoal", "ModulusMargin", "NoiseGain", "PhaseMargin", "Wishes"]

Range = tuple[float, float]
_NARROW = 0.1  # half width of an excluded region where it stands for a line: 10 % of gain, 0.1 rad of phase


class Goal(ABC):
    """Something wished; `over` are ranges of values, by path, in which it shall hold (`delay`: at `delay_at`)."""

    kind: str
    over: Mapping[str, Range]


class MarginGoal(Goal):
    """A margin that shall be at least `least`, everywhere in `over`."""

    least: float
    unit: str

    @abstractmethod
    def outside(self, re: ca.MX, im: ca.MX, tighter: Scalar) -> ca.MX:
        """At least 1 where L = re + j im lies outside the region to be kept clear, `tighter` times enlarged."""

    @abstractmethod
    def size(self, margins: Margins) -> float:
        """The margin as a size that grows from 0 (at the critical point) with distance; 0 where unstable."""

    @property
    @abstractmethod
    def least_size(self) -> float:
        """`least` as such a size."""

    @abstractmethod
    def shown(self, size: float) -> float:
        """The margin itself, from its size."""


@final
@dataclass(frozen=True, kw_only=True)
class BandError(Goal):
    """The mean over log ω in the band of |L_bench(jω)/L_flight(jω) - 1|², times `weight`, as small as possible.

    band: Hz. most: the value that is good enough (None: none is asked for, the less the better).
    """

    band: Range
    weight: float = 1.0
    most: float | None = None
    over: Mapping[str, Range] = field(default_factory=dict)

    kind = "band_error"


@final
@dataclass(frozen=True, kw_only=True)
class NoiseGain(Goal):
    """The noise gain of block `of` (default: of every block whose values vary) at most `most`, without unit.

    Sampled: white-noise gain, the root of the mean of |C(e^{jωT})|² over 0..π/T. Continuous: |C(jω)| for ω → ∞.
    """

    most: float
    of: str | None = None
    over: Mapping[str, Range] = field(default_factory=dict)

    kind = "noise_gain"


@final
@dataclass(frozen=True, kw_only=True)
class PhaseMargin(MarginGoal):
    """|phase margin| at least `least` rad: L keeps off the ellipse of that half height about -1 in Nichols's chart."""

    least: float
    over: Mapping[str, Range] = field(default_factory=dict)

    kind = "phase_margin"
    unit = "rad"

    def outside(self, re: ca.MX, im: ca.MX, tighter: Scalar) -> ca.MX:
        gain, phase = _nichols(re, im)
        return (gain / _NARROW) ** 2 + (phase / (tighter * self.least)) ** 2

    def size(self, margins: Margins) -> float:
        return abs(_known(margins, margins.phase_margin))

    @property
    def least_size(self) -> float:
        return self.least

    def shown(self, size: float) -> float:
        return size


@final
@dataclass(frozen=True, kw_only=True)
class GainMargin(MarginGoal):
    """Gain margin a factor of at least `least` (> 1) up and down: an ellipse of half width ln `least`."""

    least: float
    over: Mapping[str, Range] = field(default_factory=dict)

    kind = "gain_margin"
    unit = ""

    def outside(self, re: ca.MX, im: ca.MX, tighter: Scalar) -> ca.MX:
        gain, phase = _nichols(re, im)
        return (gain / (tighter * self.least_size)) ** 2 + (phase / _NARROW) ** 2

    def size(self, margins: Margins) -> float:
        known = _known(margins, margins.gain_margin)
        return abs(math.log(known)) if known > 0 else 0.0

    @property
    def least_size(self) -> float:
        return math.log(self.least)

    def shown(self, size: float) -> float:
        return math.exp(size)


@final
@dataclass(frozen=True, kw_only=True)
class ModulusMargin(MarginGoal):
    """min |1 + L| at least `least`: L keeps off a disk about -1."""

    least: float
    over: Mapping[str, Range] = field(default_factory=dict)

    kind = "modulus_margin"
    unit = ""

    def outside(self, re: ca.MX, im: ca.MX, tighter: Scalar) -> ca.MX:
        return ((1 + re) ** 2 + im**2) / (tighter * self.least) ** 2

    def size(self, margins: Margins) -> float:
        return _known(margins, margins.modulus_margin)

    @property
    def least_size(self) -> float:
        return self.least

    def shown(self, size: float) -> float:
        return size


@final
@dataclass(frozen=True)
class Wishes:
    """What may move, vary: path -> (low, high), and what is wished of it."""

    vary: Mapping[str, Range]
    goals: tuple[Goal, ...]


def _nichols(re: ca.MX, im: ca.MX) -> tuple[ca.MX, ca.MX]:
    """ln |L| and the angle of -L in (-π, π]: both 0 at the critical point."""
    return ca.log(re**2 + im**2) / 2, ca.atan2(-im, -re)


def _known(margins: Margins, margin: float | None) -> float:
    """The margin; 0 where the loop is unstable, inf where nothing makes it so."""
    if not margins.stable:
        return 0.0
    return math.inf if margin is None else margin
