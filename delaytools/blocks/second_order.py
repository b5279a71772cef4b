"""A second-order element: actuator, sensor, motion table."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["SecondOrder"]


@final
@dataclass(frozen=True, kw_only=True)
class SecondOrder(Continuous):
    """gain ωn² / (s² + 2 ζ ωn s + ωn²); Rao 2023, eq. 3.7.

    States: the position (the output) and its rate, in the output's unit and per second.
    """

    natural_frequency: Scalar = value("rad/s", low=0.0, exclusive=True)
    damping: Scalar = value(low=0.0)
    gain: Scalar = value(default=1.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ("output", "rate")
    initial_state = (0.0, 0.0)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        position, rate = x
        frequency = self.natural_frequency
        return rate, frequency**2 * (self.gain * u[0] - position) - 2 * self.damping * frequency * rate

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (x[0],)
