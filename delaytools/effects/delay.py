"""A constant transport delay."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.delay import Delay
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop

__all__ = ["DelayEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class DelayEffect(Effect):
    """y(t) = u(t - delay)."""

    delay: Scalar = value("s", low=0.0, neutral=0.0)

    kind = "delay"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="The signal arrives later by a fixed time, otherwise unchanged.",
        cause="Interfaces, frame boundaries, A/D and D/A conversion, a motion table or target simulator that the "
        "vehicle does not carry.",
        margins="Turns the phase by -ωτ without changing the gain: gain crossovers stay, phase margin falls by ω_c τ, "
        "the loop oscillates at a lower frequency.",
        check="Send a pulse through the element and back; the shift is the same at every frequency and amplitude.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, Delay(delay=self.delay))
