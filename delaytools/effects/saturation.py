"""A limit on a signal."""

import math
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.saturation import Saturation
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["SaturationEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class SaturationEffect(Effect):
    """y = clip(u, ±limit)."""

    limit: Scalar = value("signal", low=0.0, neutral=math.inf)

    kind = "saturation"
    acts_on = ("input", "output")
    amplitude_dependent = True
    knowledge = Knowledge(
        what="Beyond a limit on either side the signal stays at the limit.",
        cause="End stops of a fin, the range of a D/A card or a rate gyro, the current limit of an amplifier.",
        margins="Lowers the gain for large signals only: harmless to a loop that stays stable at low gain, but a "
        "conditionally stable loop, an unstable vehicle or an integrator that winds up is lost.",
        check="Repeat one sine at growing amplitude: the crests flatten at one fixed level, the zero crossings stay.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, Saturation(limit=self.limit))
