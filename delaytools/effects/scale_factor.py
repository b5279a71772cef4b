"""A wrong scale."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.scale_factor import ScaleFactor
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["ScaleFactorEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class ScaleFactorEffect(Effect):
    """y = factor u."""

    factor: Scalar = value(neutral=1.0)

    kind = "scale_factor"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="The signal is larger or smaller than it should be, by one factor at all frequencies and amplitudes.",
        cause="Calibration of a gyro or pick-off, a mistaken conversion constant, converter ranges that differ on the "
        "two sides of a cable, supply voltage, control effectiveness off its table value.",
        margins="Moves the gain crossover and uses up gain margin directly: 20 log10(factor) dB; phase is untouched.",
        check="Apply three steady levels and compare both ends: the points lie on a line through the origin with the "
        "wrong slope.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, ScaleFactor(factor=self.factor))
