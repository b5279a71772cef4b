"""An offset."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.bias import Bias
from delaytools.blocks.block import Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["BiasEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class BiasEffect(Effect):
    """y = u + level."""

    level: Scalar = value("signal", neutral=0.0)

    kind = "bias"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="A constant is added to the signal.",
        cause="Gyro bias, converter offset, a fin rigged off its zero, earth rate seen by a gyro on the table.",
        margins="None in a linear loop; it shifts the operating point, so dead bands, limits and tables act elsewhere, "
        "and an integrated rate drifts away.",
        check="Command nothing for some seconds: the mean of the signal is not zero and does not change with gain.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, Bias(level=self.level))
