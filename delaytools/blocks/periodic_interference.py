"""A sine added to a signal."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["PeriodicInterference"]


@final
@dataclass(frozen=True, kw_only=True)
class PeriodicInterference(Continuous):
    """y = u + amplitude sin(2π frequency t + phase), frequency in Hz."""

    amplitude: Scalar = value("signal", low=0.0, neutral=0.0)
    frequency: Scalar = value("Hz", low=0.0)
    phase: Scalar = value("rad", default=0.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (u[0] + self.amplitude * ca.sin(2 * math.pi * self.frequency * t + self.phase),)
