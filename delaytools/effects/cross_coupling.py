"""One channel leaking into another."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.cross_coupling import CrossCoupling
from delaytools.effects.effect import Effect, Knowledge, Place, act_at, insert_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FORCE, Modifier, StateView
from delaytools.signals.expression import signal_expression

__all__ = ["CrossCouplingEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class CouplingForce(Modifier):
    """v' = … + gain source."""

    state: str
    source: str
    gain: Scalar = value(neutral=0.0)

    stage = FORCE
    amplitude_dependent = False

    @property
    def sources(self) -> tuple[str, ...]:
        return (self.source,)

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        return {self.state: view.rates[self.state] + self.gain * view.sources[0]}


@final
@dataclass(frozen=True, kw_only=True)
class CrossCouplingEffect(Effect):
    """y = u + gain source on a signal, v' = … + gain source on a derivative."""

    gain: Scalar = value(neutral=0.0)
    source: str = value("name")

    kind = "cross_coupling"
    acts_on = ("input", "output", "derivative")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="A share of another signal is added.",
        cause="Aerodynamic coupling between roll, pitch and yaw, a sensor mounted askew, four fins that differ, wires "
        "side by side, a gimbal's inertia on the axis next to it.",
        margins="Opens a second way round the loop: single-axis margins no longer tell the whole, and two stable axes "
        "can be unstable together.",
        check="Excite one axis alone and look at the other: what appears there has the same wave form and changes sign "
        "with the excitation.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        if place.port.kind == "derivative":
            return act_at(
                loop, place, CouplingForce(state=place.port.name, source=self.source, gain=self.gain)
            )
        sources = {"source": signal_expression(self.source)}
        return insert_at(loop, place, self, CrossCoupling(gain=self.gain), sources=sources)
