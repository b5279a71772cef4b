"""The inverse compensator: one step of linear extrapolation, on the simulation PC."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Sampled, Scalar, value
from delaytools.signals.trouble import DesignError

__all__ = ["InverseCompensator", "alpha_for"]


@final
@dataclass(frozen=True, kw_only=True)
class InverseCompensator(Sampled):
    """y[k] = α u[k] - (α - 1) u[k-1]; Rao 2023, eq. 4.1.

    alpha: without unit, 1 for none (the block is then a wire, without its sampling). period: the frame of the
    simulation PC, s. Before the first sample the input is taken as 0. Ports: input, output, in one unit.
    It inverts a first-order lag of time constant -period/ln(1 - 1/α) exactly, a delay only at low frequency; its
    gain, |C|² = 1 + 4P(P + 1) sin²(ω period/2) with P = α - 1, multiplies noise.
    """

    alpha: Scalar = value(neutral=1.0)
    period: Scalar = value("s", low=0.0, exclusive=True)

    inputs = ("input",)
    outputs = ("output",)
    states = ("previous",)
    initial_state = (0.0,)

    def update(
        self, x: Sequence[Scalar], u: Sequence[Scalar], held: Sequence[Scalar]
    ) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        return (u[0],), (self.alpha * u[0] - (self.alpha - 1) * x[0],)


def alpha_for(delay: float, period: float) -> float:
    """α = 1 + delay/period, both in s: 16 for 15 ms at 1 ms; Rao 2023, eq. 4.2.

    Raises DesignError for a negative delay or a period that is not positive.
    """
    if not (delay >= 0 and period > 0):
        raise DesignError(
            "a delay is at least 0 and a period above 0",
            found=f"delay {delay:g} s, period {period:g} s",
            advice="give both in s",
        )
    return 1 + delay / period
