"""Friction that grows with the load."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, act_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FRICTION, Modifier, StateView

__all__ = ["LoadDependentFrictionEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class LoadDependentFriction(Modifier):
    """v' = … - coefficient abs(load) tanh(v / smoothing), load = a signal, or the other terms that are no friction."""

    state: str
    signal: str | None = None
    coefficient: Scalar = value(low=0.0, neutral=0.0)
    smoothing: Scalar = value("rate", low=0.0, exclusive=True, default=0.2)

    stage = FRICTION
    amplitude_dependent = True

    @property
    def sources(self) -> tuple[str, ...]:
        return (self.signal,) if self.signal else ()

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        load = view.sources[0] if self.signal else view.load
        resistance = self.coefficient * ca.fabs(load) * ca.tanh(view.states[self.state] / self.smoothing)
        return {self.state: view.rates[self.state] - resistance}


@final
@dataclass(frozen=True, kw_only=True)
class LoadDependentFrictionEffect(Effect):
    """v' = … - coefficient abs(load) tanh(v / smoothing), load = the other terms that are no friction.

    These cancel where a gear holds a weight still though it carries both: `load` names a signal to take instead.
    """

    coefficient: Scalar = value(low=0.0, neutral=0.0)
    smoothing: Scalar = value("rate", low=0.0, exclusive=True, default=0.2)
    load: str | None = value("name", default=None)

    kind = "load_dependent_friction"
    acts_on = ("derivative",)
    amplitude_dependent = True
    knowledge = Knowledge(
        what="The resistance is a share of the load that the drive carries, whatever the speed.",
        cause="Tooth friction in worm and high-ratio gears, hinge bearings pressed by aerodynamic load on the fin.",
        margins="Takes gain away in both directions and damps, more so under load: the loop is tamer on a loaded bench "
        "than in free air, or the other way round.",
        check="Hang weights on the axis and raise and lower them at one speed: half the difference of the two currents "
        "grows with the weight.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        friction = LoadDependentFriction(
            state=place.port.name, signal=self.load, coefficient=self.coefficient, smoothing=self.smoothing
        )
        return act_at(loop, place, friction)
