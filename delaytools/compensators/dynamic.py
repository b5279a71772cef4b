"""Dynamic compensation (CDRS): what the motion table failed to do, added to what the sensor felt."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["DynamicCompensator", "DynamicCompensatorAlone"]


@final
@dataclass(frozen=True, kw_only=True)
class DynamicCompensator(Continuous):
    """y = u + K_con (r - w); Rao 2023, eq. 4.15 combined with the measured signal as in fig. 4.1 and 4.7.

    Ports: input u (the sensor or the static compensator), desired r (rate asked of the table), actual w (rate the
    table had), output y, all in one unit. K_con: without unit, 0 for none; the thesis uses 1.2.
    w comes without the sensor's lag and so does r: the loop shows an ultimate gain that the vehicle has not.
    """

    K_con: Scalar = value(neutral=0.0)

    inputs = ("input", "desired", "actual")
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        measured, desired, actual = u
        return (measured + self.K_con * (desired - actual),)


@final
@dataclass(frozen=True, kw_only=True)
class DynamicCompensatorAlone(Continuous):
    """y = K_con (r - w), eq. 4.15 of Rao 2023 exactly as printed.

    Ports: desired r, actual w, output y, all in one unit; no neutral value. Where the table follows at low
    frequency, r - w vanishes there: alone in a loop it is a differentiator and feeds back no steady rate.
    """

    K_con: Scalar = value(default=1.2)

    inputs = ("desired", "actual")
    outputs = ("output",)
    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        desired, actual = u
        return (self.K_con * (desired - actual),)
