"""Coulomb friction."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, act_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FRICTION, Modifier, StateView

__all__ = ["CoulombFrictionEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class CoulombFriction(Modifier):
    """v' = … - level tanh(v / smoothing)."""

    state: str
    level: Scalar = value("derivative", low=0.0, neutral=0.0)
    smoothing: Scalar = value("rate", low=0.0, exclusive=True, default=0.2)

    stage = FRICTION
    sources = ()
    amplitude_dependent = True

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        rate = view.states[self.state]
        return {self.state: view.rates[self.state] - self.level * ca.tanh(rate / self.smoothing)}


@final
@dataclass(frozen=True, kw_only=True)
class CoulombFrictionEffect(Effect):
    """v' = … - level tanh(v / smoothing), smoothing small against the rates seen."""

    level: Scalar = value("derivative", low=0.0, neutral=0.0)
    smoothing: Scalar = value("rate", low=0.0, exclusive=True, default=0.2)

    kind = "coulomb_friction"
    acts_on = ("derivative",)
    amplitude_dependent = True
    knowledge = Knowledge(
        what="A constant resistance against motion, whatever the speed.",
        cause="Bearings, seals, gears and brushes of actuators and motion tables.",
        margins="Damps small motion, so it hides a loss of margin at small amplitude; with integral action it makes "
        "the loop stick and slip.",
        check="A slow triangle as command: flat tops at each reversal, the same width at every speed.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        friction = CoulombFriction(state=place.port.name, level=self.level, smoothing=self.smoothing)
        return act_at(loop, place, friction)
