"""A first-order lag."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.lag import Lag
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["LagEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class LagEffect(Effect):
    """y = u / (time_constant s + 1)."""

    time_constant: Scalar = value("s", low=0.0, neutral=0.0)

    kind = "lag"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="The signal follows with a first-order lag: slow parts come through late, fast parts also smaller.",
        cause="Anti-aliasing and noise filters in front of converters, the bandwidth of an amplifier, valve or "
        "target simulator that the model takes as immediate.",
        margins="Takes the phase atan(ω T) at crossover, like a delay of T at low frequency, but lowers the gain "
        "above 1/T, so it costs less margin than a delay of the same size.",
        check="Raise the frequency of a sine until the gain falls: a lag is 3 dB down at 45 deg of phase, a pure "
        "delay keeps its gain at any phase.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, Lag(time_constant=self.time_constant))
