"""EMPS with an effect that its user writes: the asymmetry that the publication names and no catalogue holds."""

from dataclasses import dataclass
from typing import final

import pytest

from benchmarks.measured_errors import LOGS, SETS, diagnosed
from delaytools.blocks.block import Scalar, value
from delaytools.design.catalogue import with_effects
from delaytools.effects.effect import Effect, Knowledge, Place, act_at
from delaytools.effects.formula import FormulaForce
from delaytools.loop.loop import Loop
from delaytools.signals.expression import Expression


@final
@dataclass(frozen=True, kw_only=True)
class AsymmetricDamping(Effect):
    """v' = … + coefficient abs(v): viscous friction that differs with the direction."""

    coefficient: Scalar = value(neutral=0.0)

    kind = "asymmetric_damping"
    acts_on = ("derivative",)
    amplitude_dependent = False
    knowledge = Knowledge(
        what="Viscous friction that is larger in one direction.",
        cause="A seal or a preloaded ball screw that drags more one way.",
        margins="Damping differs by direction.",
        check="Hold the same speed forth and back and compare the force.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        values = {"coefficient": self.coefficient}
        force = FormulaForce(state=place.port.name, formula=Expression("coefficient*abs(v)"), parameters=values)
        return act_at(loop, place, force)


@pytest.mark.skipif(not LOGS.is_dir(), reason="the measured logs are not part of the project")
@pytest.mark.measured
@pytest.mark.timeout(600)
def test_a_users_own_effect_takes_the_place_of_the_offset() -> None:
    """Published (Janot et al.): 20.4 N, 203.5 N s/m and an asymmetry. Least squares of force on the measured
    acceleration (zero-phase filter of 100 Hz) give 36.8 N s/m for it and 0.25 N of offset beside it."""
    with with_effects(AsymmetricDamping):
        found, _ = diagnosed(SETS["emps"], LOGS, budget=400.0)
    assert [one.effect for one in found.missing] == ["coulomb_friction", "asymmetric_damping"]
    assert all(one.certain and one.at == "drive.v'" for one in found.missing)
    mass = found.tolerated["drive.mass"].value
    friction, asymmetry = found.missing
    assert mass * friction.parameters["level"].value == pytest.approx(20.4, rel=0.05)
    assert mass * asymmetry.parameters["coefficient"].value == pytest.approx(36.8, rel=0.1)
    assert found.tolerated["drive.viscous"].value == pytest.approx(203.5, rel=0.03)
    rms = {step.step: step.errors["position"] for step in found.ladder}
    assert list(rms.values())[-1] < 0.1 * rms["tolerances fitted"]
