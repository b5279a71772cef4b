"""Quantisation."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.quantizer import Quantizer
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["QuantizationEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class QuantizationEffect(Effect):
    """y = step round(u / step), halves rounded up."""

    step: Scalar = value("signal", low=0.0, neutral=0.0)

    kind = "quantization"
    acts_on = ("input", "output")
    amplitude_dependent = True
    knowledge = Knowledge(
        what="The signal takes only values a fixed step apart.",
        cause="Converters of few bits or a range set too wide, encoder lines, fixed-point words on the bus to the "
        "on-board computer.",
        margins="For large signals a noise of step/√12; near zero the gain jumps between 0 and up to 4/π, so a loop "
        "with integral action hunts by one step, and a differentiated signal spikes.",
        check="Sort the recorded values and take differences: they are multiples of one number; at rest the signal "
        "is exactly constant or toggles between two values.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, Quantizer(step=self.step))
