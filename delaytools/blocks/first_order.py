"""A first-order lag."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["FirstOrder"]


@final
@dataclass(frozen=True, kw_only=True)
class FirstOrder(Continuous):
    """gain / (time_constant s + 1)."""

    time_constant: Scalar = value("s", low=0.0, exclusive=True)
    gain: Scalar = value(default=1.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ("output",)
    initial_state = (0.0,)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ((self.gain * u[0] - x[0]) / self.time_constant,)

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (x[0],)
