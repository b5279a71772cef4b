"""Static compensation (CFMS): phase lead on the measured signal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["LeadCompensator"]


@final
@dataclass(frozen=True, kw_only=True)
class LeadCompensator(Continuous):
    """(1 + s τ) / (1 + s τ/N); static compensation of Rao 2023, ch. 4.

    tau: the delay to make up for, s, 0 for none. N: ratio of the corner frequencies, ≥ 1; the gain rises from 1 to
    N, the lead lasts up to N/τ rad/s, with its largest value asin((N - 1)/(N + 1)) at √N/τ. Ports: input, output,
    in one unit. The state is the input behind the lag τ/N; it starts at 0.
    """

    tau: Scalar = value("s", low=0.0, neutral=0.0)
    N: Scalar = value(low=1.0, default=10.0)

    inputs = ("input",)
    outputs = ("output",)
    states = ("lagged",)
    initial_state = (0.0,)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (self.N * (u[0] - x[0]) / self.tau,)

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (self.N * u[0] + (1 - self.N) * x[0],)
