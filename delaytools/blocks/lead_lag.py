"""A lead-lag filter."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["LeadLag"]


@final
@dataclass(frozen=True, kw_only=True)
class LeadLag(Continuous):
    """gain (lead s + 1) / (lag s + 1), with both time constants in s."""

    lead: Scalar = value("s", low=0.0)
    lag: Scalar = value("s", low=0.0, exclusive=True)
    gain: Scalar = value(default=1.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ("x1",)
    initial_state = (0.0,)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ((u[0] - x[0]) / self.lag,)

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        ratio = self.lead / self.lag
        return (self.gain * (ratio * u[0] + (1 - ratio) * x[0]),)
