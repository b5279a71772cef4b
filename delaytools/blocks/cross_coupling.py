"""One signal leaking into another."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["CrossCoupling"]


@final
@dataclass(frozen=True, kw_only=True)
class CrossCoupling(Continuous):
    """y = u + gain source."""

    gain: Scalar = value(neutral=0.0)

    inputs = ("input", "source")
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (u[0] + self.gain * u[1],)
