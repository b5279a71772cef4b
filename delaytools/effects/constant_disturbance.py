"""A constant force or moment."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, act_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FORCE, Modifier, StateView

__all__ = ["ConstantDisturbanceEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class ConstantForce(Modifier):
    """v' = … + level."""

    state: str
    level: Scalar = value("derivative", neutral=0.0)

    stage = FORCE
    sources = ()
    amplitude_dependent = False

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        return {self.state: view.rates[self.state] + self.level}


@final
@dataclass(frozen=True, kw_only=True)
class ConstantDisturbanceEffect(Effect):
    """v' = … + level."""

    level: Scalar = value("derivative", neutral=0.0)

    kind = "constant_disturbance"
    acts_on = ("derivative",)
    amplitude_dependent = False
    knowledge = Knowledge(
        what="A constant force or moment acts all the time, in one direction.",
        cause="Thrust misalignment, fins set askew (a roll moment), an unbalanced load on the table, cable pull, "
        "wind from one side.",
        margins="None in a linear loop; it asks for a steady deflection, takes from the actuator's range and lets a "
        "loop without integral action hang off by a constant error.",
        check="Read the steady actuator deflection with nothing commanded; turn the load or the vehicle by 180 deg: "
        "gravity and cables change the sign, a sensor's bias does not.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return act_at(loop, place, ConstantForce(state=place.port.name, level=self.level))
