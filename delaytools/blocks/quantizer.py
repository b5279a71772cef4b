"""Quantisation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["Quantizer"]

HUGE = 2.0**900


@final
@dataclass(frozen=True, kw_only=True)
class Quantizer(Continuous):
    """y = step round(u / step), halves rounded up.

    Its derivative by u is 1: what a signal that moves over many steps does on average, where the exact one, 0 but at
    jumps, would tell a fit nothing of what comes before.
    """

    step: Scalar = value("signal", low=0.0, neutral=0.0)

    amplitude_dependent = True
    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        nothing = u[0] - ca.floor(u[0] * HUGE) / HUGE  # 0, since a double so large is whole; its derivative is 1
        return (self.step * ca.floor(u[0] / self.step + 0.5) + nothing,)
