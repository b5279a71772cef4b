"""A limit on a signal."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["Saturation"]


@final
@dataclass(frozen=True, kw_only=True)
class Saturation(Continuous):
    """y = clip(u, ±limit)."""

    limit: Scalar = value("signal", low=0.0, neutral=math.inf)

    amplitude_dependent = True
    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (ca.fmax(ca.fmin(u[0], self.limit), -self.limit),)
