"""A gain that drifts."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.gain_drift import GainDrift
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["GainDriftEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class GainDriftEffect(Effect):
    """y = (1 + rate t) u, t in s from the start of the run."""

    rate: Scalar = value("1/s", neutral=0.0)

    kind = "gain_drift"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="The gain grows or shrinks steadily during the run.",
        cause="Warming amplifiers and gyros, a battery or hydraulic accumulator running down, dynamic pressure that "
        "the model takes as constant.",
        margins="The gain margin at the start is not the one at the end: a loop may begin to oscillate late in a run.",
        check="Send the same pulse at the start and at the end of a long run and compare the size of the answers; "
        "repeat after a cold start.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, GainDrift(values={"rate": self.rate}))
