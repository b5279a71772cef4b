"""Friction that is largest just at breakaway."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, act_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FRICTION, Modifier, StateView

__all__ = ["StribeckFrictionEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class StribeckFriction(Modifier):
    """v' = … - (level + (stiction - level) exp(-(v/speed)²)) tanh(v / smoothing)."""

    state: str
    level: Scalar = value("derivative", low=0.0, neutral=0.0)
    stiction: Scalar = value("derivative", low=0.0, neutral=0.0)
    speed: Scalar = value("rate", low=0.0, exclusive=True)
    smoothing: Scalar = value("rate", low=0.0, exclusive=True, default=0.2)

    stage = FRICTION
    sources = ()
    amplitude_dependent = True

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        rate = view.states[self.state]
        level = self.level + (self.stiction - self.level) * ca.exp(-((rate / self.speed) ** 2))
        return {self.state: view.rates[self.state] - level * ca.tanh(rate / self.smoothing)}


@final
@dataclass(frozen=True, kw_only=True)
class StribeckFrictionEffect(Effect):
    """v' = … - (level + (stiction - level) exp(-(v/speed)²)) tanh(v / smoothing); Armstrong-Hélouvry 1991."""

    level: Scalar = value("derivative", low=0.0, neutral=0.0)
    stiction: Scalar = value("derivative", low=0.0, neutral=0.0)
    speed: Scalar = value("rate", low=0.0, exclusive=True)
    smoothing: Scalar = value("rate", low=0.0, exclusive=True, default=0.2)

    kind = "stribeck_friction"
    acts_on = ("derivative",)
    amplitude_dependent = True
    knowledge = Knowledge(
        what="Friction is highest at breakaway and falls to a steady level once the motion is fast enough.",
        cause="Greased bearings, gears and seals in boundary lubrication, most of all after a long rest or when cold.",
        margins="The falling branch is a negative damping: with integral action and slow commands the axis sticks, "
        "jumps and sticks again, however large the linear margins are.",
        check="Measure motor current at several steady slow speeds: it falls with speed before it rises; Coulomb "
        "friction alone is flat.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        friction = StribeckFriction(
            state=place.port.name,
            level=self.level,
            stiction=self.stiction,
            speed=self.speed,
            smoothing=self.smoothing,
        )
        return act_at(loop, place, friction)
