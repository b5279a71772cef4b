"""A limit on the speed of a signal."""

import math
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Follower, Scalar, value

__all__ = ["RateLimiter"]


@final
@dataclass(frozen=True, kw_only=True)
class RateLimiter(Follower):
    """The slew limit: y follows u with abs(y') ≤ limit."""

    limit: Scalar = value("signal/s", low=0.0, neutral=math.inf)

    amplitude_dependent = True
    inputs = ("input",)
    outputs = ("output",)
    start = None

    def follow(self, memory: Scalar, u: Scalar, elapsed: Scalar) -> Scalar:
        reach = self.limit * elapsed
        return ca.fmax(ca.fmin(u, memory + reach), memory - reach)
