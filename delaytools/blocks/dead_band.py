"""A dead band."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["DeadBand"]


@final
@dataclass(frozen=True, kw_only=True)
class DeadBand(Continuous):
    """y = u - clip(u, ±half_width)."""

    half_width: Scalar = value("signal", low=0.0, neutral=0.0)

    amplitude_dependent = True
    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (u[0] - ca.fmax(ca.fmin(u[0], self.half_width), -self.half_width),)
