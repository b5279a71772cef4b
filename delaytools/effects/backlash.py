"""Backlash."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.backlash import Backlash
from delaytools.blocks.block import Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["BacklashEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class BacklashEffect(Effect):
    """y(t) = clip(y(t₀), u(t) ± half_width): the play operator, starting centred."""

    half_width: Scalar = value("signal", low=0.0, neutral=0.0)

    kind = "backlash"
    acts_on = ("input", "output")
    amplitude_dependent = True
    knowledge = Knowledge(
        what="At every reversal the output stands still until the play of twice the half width is taken up.",
        cause="Gear trains, keyways, linkages and worn couplings between motor and fin, or between table and sensor.",
        margins="Loses gain and phase at small amplitude (90 deg where the amplitude nears the half width), so a "
        "loop with an integrator in it often keeps a small steady limit cycle.",
        check="Plot output over input for a slow sine: two parallel branches a constant distance apart, the same "
        "at any bias and amplitude; a dead band has one branch.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, Backlash(half_width=self.half_width))
