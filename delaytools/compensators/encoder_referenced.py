"""Encoder-referenced compensation: the sensor's answer to what the table failed to do is put back."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["EncoderReferencedCompensator"]


@final
@dataclass(frozen=True, kw_only=True)
class EncoderReferencedCompensator(Continuous):
    """y = u + S(s) (r - w), S = ωn² / (s² + 2 ζ ωn s + ωn²) a model of the sensor.

    Ports: input u = S_true w (the sensor on the table), desired r (rate asked of the table), actual w (the table's
    encoder rate), output y, all in one unit. natural_frequency rad/s and damping of the model. With S = S_true:
    S w + S (r - w) = S r for any table and any delay, constant or varying; noise of the sensor passes with gain 1.
    A bandwidth of S 20 % off moves the ultimate gain of the thesis's rate loop from 130.8 to 106 or 157.
    """

    natural_frequency: Scalar = value("rad/s", low=0.0, exclusive=True)
    damping: Scalar = value(low=0.0)

    inputs = ("input", "desired", "actual")
    outputs = ("output",)
    states = ("model", "rate")
    initial_state = (0.0, 0.0)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        (model, rate), (_, desired, actual) = x, u
        frequency = self.natural_frequency
        missed = desired - actual
        return rate, frequency**2 * (missed - model) - 2 * self.damping * frequency * rate

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (u[0] + x[0],)
