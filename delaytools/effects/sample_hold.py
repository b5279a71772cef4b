"""Sampling with a zero-order hold."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.sample_hold import SampleHold
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["SampleHoldEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class SampleHoldEffect(Effect):
    """y = u at t = 0, period, 2 period, …, held in between."""

    period: Scalar = value("s", low=0.0, neutral=0.0)

    kind = "sample_hold"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="The signal is taken at regular instants and held until the next, a staircase.",
        cause="An interface that runs slower than the simulation PC: a bus schedule, a D/A card, a table controller "
        "with its own cycle.",
        margins="Costs on average half a period of delay (phase -ω period/2 at crossover) with little loss of gain, "
        "and folds whatever lies above half the sampling frequency back into the loop.",
        check="Look at the raw column in fine time resolution: values repeat in groups of equal length; a plain "
        "delay has no steps.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, SampleHold(period=self.period))
