"""A sine added to a signal."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.periodic_interference import PeriodicInterference
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["PeriodicInterferenceEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class PeriodicInterferenceEffect(Effect):
    """y = u + amplitude sin(2π frequency t + phase)."""

    amplitude: Scalar = value("signal", low=0.0, neutral=0.0)
    frequency: Scalar = value("Hz", low=0.0)
    phase: Scalar = value("rad", default=0.0)

    kind = "periodic_interference"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="A tone of fixed frequency and size is added, whatever the loop does.",
        cause="Mains hum and ground loops (50 or 60 Hz and its multiples), a rotating imbalance, switching supplies "
        "folded down by sampling (Rao 2023 reports a 60 Hz line in the complete set-up).",
        margins="None, it is no part of the loop; but the loop amplifies it by its sensitivity, and near crossover it "
        "is easily taken for an oscillation of the loop.",
        check="Open the loop and command nothing: the line stays, at the same frequency, and does not move when a loop "
        "gain is changed.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        block = PeriodicInterference(amplitude=self.amplitude, frequency=self.frequency, phase=self.phase)
        return insert_at(loop, place, self, block)
