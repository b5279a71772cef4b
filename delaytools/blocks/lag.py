"""A lag that a signal may have."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["Lag"]


@final
@dataclass(frozen=True, kw_only=True)
class Lag(Continuous):
    """1 / (time_constant s + 1); unlike FirstOrder it may be 0, a wire. At t = 0 its output is 0."""

    time_constant: Scalar = value("s", low=0.0, neutral=0.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ("output",)
    initial_state = (0.0,)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ((u[0] - x[0]) / self.time_constant,)

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (x[0],)
