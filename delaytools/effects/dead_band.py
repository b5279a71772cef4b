"""A dead band."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.dead_band import DeadBand
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["DeadBandEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class DeadBandEffect(Effect):
    """y = u - clip(u, ±half_width)."""

    half_width: Scalar = value("signal", low=0.0, neutral=0.0)

    kind = "dead_band"
    acts_on = ("input", "output")
    amplitude_dependent = True
    knowledge = Knowledge(
        what="Small commands have no effect; larger ones lose the half width.",
        cause="Valve overlap, gear slack under spring load, a threshold in the actuator's drive (±0.3 deg in the "
        "hardware actuators of Rao 2023).",
        margins="Lowers the loop gain for small signals, so a loop that is stable at full gain stays stable, but an "
        "unstable or integrating plant drifts inside the band and can limit-cycle.",
        check="Drive the element with a small oscillation about zero, then about a bias: the loss vanishes at the "
        "bias.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, DeadBand(half_width=self.half_width))
