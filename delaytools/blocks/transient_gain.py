"""A gain that is off for a while."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["TransientGain"]

SAME_INSTANT = 1e-12  # s; times closer than this are one


@final
@dataclass(frozen=True, kw_only=True)
class TransientGain(Continuous):
    """y = factor u for start ≤ t < end, y = u elsewhere; the grid of a run is split at `jumps`."""

    factor: Scalar = value(neutral=1.0)
    start: Scalar = value("s")
    end: Scalar = value("s")

    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()
    jump_values = ("start", "end")

    @property
    def jumps(self) -> tuple[Scalar, Scalar]:
        """Times (s) at which the factor changes: the values named in `jump_values`."""
        return self.start, self.end

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        inside = ca.logic_and(t >= self.start - SAME_INSTANT, t < self.end - SAME_INSTANT)
        return (ca.if_else(inside, self.factor, 1.0) * u[0],)
