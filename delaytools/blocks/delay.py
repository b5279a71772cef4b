"""Transport delays, constant and varying."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from delaytools.blocks.block import Scalar, Transport, value

__all__ = ["Delay", "SignalDelay", "VariableDelay"]


@final
@dataclass(frozen=True, kw_only=True)
class Delay(Transport):
    """y(t) = u(t - τ), exact for any τ ≥ 0: e^(-sτ)."""

    delay: Scalar = value("s", low=0.0, neutral=0.0)

    inputs = ("input",)
    outputs = ("output",)
    varies = False

    def seconds(self, t: Scalar, u: Sequence[Scalar]) -> Scalar:
        return self.delay


@final
@dataclass(frozen=True, kw_only=True)
class VariableDelay(Transport):
    """y(t) = u(t - τ(t)), τ = mean + amplitude sin(2π frequency t + phase), never below 0."""

    mean: Scalar = value("s", low=0.0, neutral=0.0)
    amplitude: Scalar = value("s", low=0.0, default=0.0, neutral=0.0)
    frequency: Scalar = value("Hz", low=0.0, default=1.0)
    phase: Scalar = value("rad", default=0.0)

    inputs = ("input",)
    outputs = ("output",)
    varies = True

    def seconds(self, t: Scalar, u: Sequence[Scalar]) -> Scalar:
        wave = np.sin(2 * math.pi * self.frequency * t + self.phase)
        return np.fmax(self.mean + self.amplitude * wave, 0.0)


@final
@dataclass(frozen=True, kw_only=True)
class SignalDelay(Transport):
    """y(t) = u(t - τ(t)), τ given in s by a second input, a column of a log."""

    inputs = ("input", "delay")
    outputs = ("output",)
    varies = True

    def seconds(self, t: Scalar, u: Sequence[Scalar]) -> Scalar:
        return np.fmax(u[0], 0.0)
