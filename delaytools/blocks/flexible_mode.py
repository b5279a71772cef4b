"""A flexible mode that one signal excites and another shows."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["FlexibleMode"]


@final
@dataclass(frozen=True, kw_only=True)
class FlexibleMode(Continuous):
    """y = u + gain ω s / (s² + 2ζω s + ω²) source, ω = 2π frequency (Hz), ζ = damping.

    States: z, ż with z'' + 2ζω z' + ω² z = ω source, so that y = u + gain ż; at resonance gain / (2ζ) of the source.
    """

    gain: Scalar = value(neutral=0.0)
    frequency: Scalar = value("Hz", low=0.0, exclusive=True)
    damping: Scalar = value(low=0.0)

    inputs = ("input", "source")
    outputs = ("output",)
    states = ("deflection", "speed")
    initial_state = (0.0, 0.0)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        deflection, speed = x
        frequency = 2 * math.pi * self.frequency
        return speed, frequency * u[1] - 2 * self.damping * frequency * speed - frequency**2 * deflection

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (u[0] + self.gain * x[1],)
