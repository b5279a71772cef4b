"""Quantisation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["Quantizer"]


@final
@dataclass(frozen=True, kw_only=True)
class Quantizer(Continuous):
    """y = step round(u / step), halves rounded up."""

    step: Scalar = value("signal", low=0.0, neutral=0.0)

    amplitude_dependent = True
    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (self.step * ca.floor(u[0] / self.step + 0.5),)
