"""A relay, with hysteresis."""

from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Follower, Scalar, value

__all__ = ["Relay"]


@final
@dataclass(frozen=True, kw_only=True)
class Relay(Follower):
    """y = level above half_width, -level below -half_width, and what it was between (Tsypkin 1984, ch. 1)."""

    level: Scalar = value("signal", low=0.0, exclusive=True)
    half_width: Scalar = value(low=0.0, default=0.0)

    amplitude_dependent = True
    inputs = ("input",)
    outputs = ("output",)
    start = None

    def follow(self, memory: Scalar, u: Scalar, elapsed: Scalar) -> Scalar:
        before = ca.if_else(memory >= 0, self.level, -self.level)
        return ca.if_else(u > self.half_width, self.level, ca.if_else(u < -self.half_width, -self.level, before))
