"""An integrator."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["Integrator"]


@final
@dataclass(frozen=True, kw_only=True)
class Integrator(Continuous):
    """y' = u, y(0) = initial."""

    initial: Scalar = value("signal", default=0.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ("output",)

    @property
    def initial_state(self) -> tuple[Scalar, ...]:
        return (self.initial,)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (u[0],)

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (x[0],)
