"""Drag with the square of speed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, act_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FORCE, Modifier, StateView

__all__ = ["QuadraticDragEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class QuadraticDrag(Modifier):
    """v' = … + coefficient v abs(v)."""

    state: str
    coefficient: Scalar = value(neutral=0.0)

    stage = FORCE
    sources = ()
    amplitude_dependent = False

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        rate = view.states[self.state]
        return {self.state: view.rates[self.state] + self.coefficient * rate * ca.fabs(rate)}


@final
@dataclass(frozen=True, kw_only=True)
class QuadraticDragEffect(Effect):
    """v' = … + coefficient v abs(v) (physical drag has a negative coefficient)."""

    coefficient: Scalar = value(neutral=0.0)

    kind = "quadratic_drag"
    acts_on = ("derivative",)
    amplitude_dependent = False
    knowledge = Knowledge(
        what="A resistance with the square of speed, always against the motion.",
        cause="Air on a fast turning table or antenna, turbulent flow in valves and lines of a hydraulic actuator.",
        margins="Adds damping in proportion to amplitude: small-signal margins are the worst case, and a growing "
        "oscillation settles at a size where the drag balances it.",
        check="Hold several steady speeds and plot the torque over speed squared: a straight line; doubling the speed "
        "takes four times the torque, against eight for a cubic damping.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        return act_at(loop, place, QuadraticDrag(state=place.port.name, coefficient=self.coefficient))
