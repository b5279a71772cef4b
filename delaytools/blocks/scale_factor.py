"""A scale factor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["ScaleFactor"]


@final
@dataclass(frozen=True, kw_only=True)
class ScaleFactor(Continuous):
    """y = factor u."""

    factor: Scalar = value(neutral=1.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (self.factor * u[0],)
