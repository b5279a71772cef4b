"""A gain that drifts with time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["GainDrift"]


@final
@dataclass(frozen=True, kw_only=True)
class GainDrift(Continuous):
    """y = (1 + rate t) u, t in s from the start of the run.

    values: {"rate": per s}; a mapping, because `rate` itself is the name of the derivatives' formula. At rate 0 the
    formula is u itself.
    """

    values: Mapping[str, Scalar] = value("1/s", many=True)

    inputs = ("input",)
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ((1 + self.values["rate"] * t) * u[0],)
