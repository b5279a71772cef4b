"""A flexible mode."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.flexible_mode import FlexibleMode
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop
from delaytools.signals.expression import signal_expression

__all__ = ["FlexibleModeEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class FlexibleModeEffect(Effect):
    """y = u + gain ω s / (s² + 2ζω s + ω²) source, ω = 2π frequency, ζ = damping."""

    gain: Scalar = value(neutral=0.0)
    frequency: Scalar = value("Hz", low=0.0, exclusive=True)
    damping: Scalar = value(low=0.0)
    source: str = value("name")

    kind = "flexible_mode"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="A structure rings at its own frequency when another signal shakes it, and the ringing is measured too.",
        cause="Body bending of the vehicle, a sensor bracket or fixture on the motion table, a long drive shaft.",
        margins="A peak of gain/(2 ζ) with a half turn of phase around the frequency: the loop crosses 0 dB there "
        "again and may whistle well above its own crossover.",
        check="Tap the structure or sweep a sine past the frequency with the loop open; add a mass to the fixture and "
        "the frequency moves, which mains hum never does.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        mode = FlexibleMode(gain=self.gain, frequency=self.frequency, damping=self.damping)
        return insert_at(loop, place, self, mode, sources={"source": signal_expression(self.source)})
