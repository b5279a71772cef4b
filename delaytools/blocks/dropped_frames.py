"""Updates that get lost."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Sampled, Scalar, value

__all__ = ["DroppedFrames"]


@final
@dataclass(frozen=True, kw_only=True)
class DroppedFrames(Sampled):
    """At every tick y = u, but where draw < probability the old y is kept; draw is uniform in [0, 1)."""

    probability: Scalar = value(low=0.0, high=1.0, neutral=0.0)
    period: Scalar = value("s", low=0.0, exclusive=True)

    inputs = ("input", "draw")
    outputs = ("output",)
    states = ()
    initial_state = ()

    def update(
        self, x: Sequence[Scalar], u: Sequence[Scalar], held: Sequence[Scalar]
    ) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        return (), (ca.if_else(u[1] < self.probability, held[0], u[0]),)
