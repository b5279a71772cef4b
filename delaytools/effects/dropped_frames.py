"""Updates that get lost on their way."""

from dataclasses import dataclass, replace
from typing import final

from delaytools.blocks.block import Sampled, Scalar, value
from delaytools.blocks.dropped_frames import DroppedFrames
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop
from delaytools.signals.expression import signal_expression
from delaytools.signals.trouble import DesignError

__all__ = ["DroppedFramesEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class DroppedFramesEffect(Effect):
    """At every update of the sampled block the old value is kept with this probability.

    The draws are the random signal `TYPE@PORT.draw` of the loop, uniform in [0, 1), read at every update.
    Raises DesignError at the output of a block that is not sampled.
    """

    probability: Scalar = value(low=0.0, high=1.0, neutral=0.0)

    kind = "dropped_frames"
    acts_on = ("output",)
    amplitude_dependent = True
    knowledge = Knowledge(
        what="Now and then an update does not arrive and the receiver goes on with the value before.",
        cause="Lost or late packets on a shared network, bus collisions, a frame overrun in the simulation PC or the "
        "on-board computer.",
        margins="Adds on average probability/(1 - probability) periods of hold, and in a burst much more: margins "
        "look right on average while single runs ring or diverge.",
        check="Compare the counter or the value at the sender and at the receiver update by update: each received "
        "value is the newest or exactly the one before.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        host = loop[place.port.element].block
        if not isinstance(host, Sampled):
            known = [f"{e.name}.{port}" for e in loop.sampled if "@" not in e.name for port in e.outputs]
            raise DesignError(
                "dropped_frames acts at the output of a sampled block",
                where=str(place.port),
                found=f"a {type(host).__name__} block",
                known=known,
                advice="put it where updates are sent, or add a sample_hold block there",
            )
        draw = _free_name(loop, f"{place.name}.draw")
        block = DroppedFrames(probability=self.probability, period=host.period)
        loop = insert_at(loop, place, self, block, sources={"draw": signal_expression(draw)})
        return replace(loop, random={**loop.random, draw: "uniform"})


def _free_name(loop: Loop, name: str) -> str:
    same = sum(other == name or other.startswith(f"{name}#") for other in loop.random)
    return f"{name}#{same + 1}" if same else name
