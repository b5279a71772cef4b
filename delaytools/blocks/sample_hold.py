"""Sampling with a zero-order hold."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Sampled, Scalar, value

__all__ = ["SampleHold"]


@final
@dataclass(frozen=True, kw_only=True)
class SampleHold(Sampled):
    """y = u at t = 0, period, 2 period, …, held in between; a period of 0 is a wire."""

    period: Scalar = value("s", low=0.0, neutral=0.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()

    def update(
        self, x: Sequence[Scalar], u: Sequence[Scalar], held: Sequence[Scalar]
    ) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        return (), (u[0],)
