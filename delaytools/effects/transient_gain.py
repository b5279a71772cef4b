"""A gain that is off for a while."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.transient_gain import TransientGain
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop
from delaytools.signals.trouble import DesignError

__all__ = ["TransientGainEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class TransientGainEffect(Effect):
    """y = factor u for start ≤ t < end, y = u elsewhere; raises DesignError where end is not after start."""

    factor: Scalar = value(neutral=1.0)
    start: Scalar = value("s")
    end: Scalar = value("s")

    kind = "transient_gain"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="For some time within the run the gain is another, then it is as before.",
        cause="A jet vane that works only in the launch phase, a supply that sags under load, a loose contact, a "
        "stage of the flight whose table value is wrong.",
        margins="Margins hold before and after, not in between: an oscillation that grows for a while and then dies.",
        check="Compare model and run window by window: the error stands in one stretch of time; look what was "
        "switched or loaded at its edges and repeat with the event moved.",
    )

    def __post_init__(self) -> None:
        numbers = isinstance(self.start, int | float) and isinstance(self.end, int | float)
        if numbers and not self.start < self.end:
            raise DesignError(
                "a transient ends after it starts",
                found=f"start {self.start:g} s, end {self.end:g} s",
                advice="give an end after the start",
            )

    def apply(self, loop: Loop, place: Place) -> Loop:
        block = TransientGain(factor=self.factor, start=self.start, end=self.end)
        return insert_at(loop, place, self, block)
