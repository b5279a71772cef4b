"""A notch filter."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["Notch"]


@final
@dataclass(frozen=True, kw_only=True)
class Notch(Continuous):
    """(s² + 2 ζz ω s + ω²) / (s² + 2 ζp ω s + ω²), ω = natural_frequency, ζz = depth_damping, ζp = damping."""

    natural_frequency: Scalar = value("rad/s", low=0.0, exclusive=True)
    damping: Scalar = value(low=0.0, exclusive=True)
    depth_damping: Scalar = value(default=0.0, low=0.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ("x1", "x2")
    initial_state = (0.0, 0.0)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        position, rate = x
        frequency = self.natural_frequency
        return rate, frequency**2 * (u[0] - position) - 2 * self.damping * frequency * rate

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        rate = x[1]
        return (u[0] - 2 * (self.damping - self.depth_damping) / self.natural_frequency * rate,)
