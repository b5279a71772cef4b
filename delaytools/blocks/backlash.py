"""Play between driving and driven part."""

from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Follower, Scalar, value

__all__ = ["Backlash"]


@final
@dataclass(frozen=True, kw_only=True)
class Backlash(Follower):
    """The play operator: y(t) = clip(y(t₀), u(t) ± half_width), starting centred (Visintin 1994, ch. III)."""

    half_width: Scalar = value("signal", low=0.0, neutral=0.0)

    amplitude_dependent = True
    inputs = ("input",)
    outputs = ("output",)
    start = None

    def follow(self, memory: Scalar, u: Scalar, elapsed: Scalar) -> Scalar:
        return ca.fmax(ca.fmin(memory, u + self.half_width), u - self.half_width)
