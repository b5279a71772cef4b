"""Damping that grows with speed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, act_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FORCE, Modifier, StateView

__all__ = ["CubicDampingEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class CubicDamping(Modifier):
    """v' = … + coefficient v³."""

    state: str
    coefficient: Scalar = value(neutral=0.0)

    stage = FORCE
    sources = ()
    amplitude_dependent = False

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        return {self.state: view.rates[self.state] + self.coefficient * view.states[self.state] ** 3}


@final
@dataclass(frozen=True, kw_only=True)
class CubicDampingEffect(Effect):
    """v' = … + coefficient v³ (physical damping has a negative coefficient)."""

    coefficient: Scalar = value(neutral=0.0)

    kind = "cubic_damping"
    acts_on = ("derivative",)
    amplitude_dependent = False
    knowledge = Knowledge(
        what="A resistance with the third power of speed: hardly there when slow, dominant when fast.",
        cause="Hydraulic orifices and dampers at high flow, aerodynamic roll damping at large rates, motors near "
        "their no-load speed.",
        margins="Invisible in the linear margins; where negative it bounds an oscillation to a limit cycle of fixed "
        "size, where positive a loop stable at small signals breaks away at large ones.",
        check="Let the element ring down from a large start: the decay per cycle shrinks with amplitude until only "
        "the linear damping is left.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return act_at(loop, place, CubicDamping(state=place.port.name, coefficient=self.coefficient))
