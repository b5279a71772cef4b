"""A spring that is not linear."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value
from delaytools.effects.effect import Effect, Knowledge, Place, act_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FORCE, Modifier, StateView
from delaytools.loop.network import position_of
from delaytools.loop.values import resolve
from delaytools.signals.trouble import DesignError

__all__ = ["CubicStiffnessEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class CubicStiffness(Modifier):
    """v' = … + coefficient x³, x the position whose derivative is v."""

    state: str
    coefficient: Scalar = value(neutral=0.0)

    stage = FORCE
    sources = ()
    amplitude_dependent = False

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        return {self.state: view.rates[self.state] + self.coefficient * view.states[view.position] ** 3}


@final
@dataclass(frozen=True, kw_only=True)
class CubicStiffnessEffect(Effect):
    """v' = … + coefficient x³ (a hardening spring has a negative coefficient); x needs a position state.

    Raises DesignError at a state that is no rate of another.
    """

    coefficient: Scalar = value(neutral=0.0)

    kind = "cubic_stiffness"
    acts_on = ("derivative",)
    amplitude_dependent = False
    knowledge = Knowledge(
        what="The restoring force grows faster, or more slowly, than the deflection.",
        cause="Hinge moment of a fin at large angles, elastomer mounts, cables that tighten, a flexure near its stop.",
        margins="Linear margins hold at small deflection; the natural frequency then climbs (hardening) or sinks with "
        "amplitude, so the frequency response depends on the size of the test signal and may jump.",
        check="Load the element statically in steps and plot force over deflection; or sweep a sine up and down at two "
        "amplitudes and see whether the peak moves.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        if not _has_position(loop, place):
            raise DesignError(
                "cubic_stiffness needs a position, and this state is no rate of another",
                where=str(place.port),
                found="a first-order state",
                advice="use a second_order block or equations with q' = v, or cubic_damping, which acts on the state",
            )
        return act_at(loop, place, CubicStiffness(state=place.port.name, coefficient=self.coefficient))


def _has_position(loop: Loop, place: Place) -> bool:
    alone = resolve(replace(loop, elements=(loop[place.port.element],)))
    block = alone.elements[0].block
    return isinstance(block, Continuous) and position_of(block, place.port.name) != ""
