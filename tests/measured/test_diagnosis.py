"""What `diagnose` names in measured logs whose missing effect is known from the literature."""

from functools import cache
from typing import Any

import pytest

from benchmarks.measured_errors import LOGS, SETS, diagnosed
from delaytools.diagnosis.answer import Diagnosis, Missing

OFFSET = ("constant_disturbance", "bias")
FORCES = ("coulomb_friction", "constant_disturbance")
BUDGET = 400.0  # s
SAMPLE = 0.08  # s, of the dryer's log


def measured(function: Any) -> Any:
    """Skipped where the logs are not at hand; minutes on a slow machine."""
    absent = pytest.mark.skipif(not LOGS.is_dir(), reason="the measured logs are not part of the project")
    return pytest.mark.measured(pytest.mark.timeout(1800)(absent(function)))


@cache
def _found(name: str) -> Diagnosis:
    return diagnosed(SETS[name], LOGS, budget=BUDGET)[0]


def _named(found: Diagnosis) -> list[str]:
    return [one.effect for one in found.missing]


def _one(found: Diagnosis, effect: str) -> Missing:
    return next(one for one in found.missing if one.effect == effect)


def _fall(found: Diagnosis, signal: str) -> float:
    """Error on data not used for the fit with what is named, as a part of that with tolerances fitted."""
    errors = [step.errors[signal] for step in found.ladder if step.step != "as designed"]
    return errors[-1] / errors[0]


@measured
def test_dryer_lacks_the_dead_time_of_three_samples() -> None:
    """Published: 3 samples, 0.24 s, of which the sampling itself is one; the design has that one as its hold."""
    found = _found("daisy_dryer")
    assert _named(found)[0] == "delay" and _one(found, "delay").certain
    assert _one(found, "delay").parameters["delay"].value + SAMPLE == pytest.approx(0.24, abs=0.04)
    assert _fall(found, "outlet_temperature") < 0.6


@measured
def test_dart_lag_and_delay_cannot_be_told_apart() -> None:
    found = _found("dart_car")
    group = next(one for one in found.confusable if one.signal == "yaw_rate")
    assert {"lag", "delay"} <= {one.effect for one in group.members}
    assert not any(one.certain for one in found.missing if one.effect in ("lag", "delay"))
    assert _fall(found, "yaw_rate") < 0.75


@measured
def test_silverbox_lacks_its_cubic_spring() -> None:
    """Published: a spring that hardens with the cube; the linear model's error falls to a tenth and less."""
    found = _found("silverbox")
    assert _named(found) == ["cubic_stiffness"]
    spring = _one(found, "cubic_stiffness")
    assert spring.certain and spring.at == "resonator.rate'"
    assert spring.parameters["coefficient"].value == pytest.approx(-7.3e5, rel=0.05)
    assert _fall(found, "output_voltage") < 0.1


@measured
def test_emps_lacks_coulomb_friction_first_then_the_offset() -> None:
    """Published (Janot et al.): 20.4 N of Coulomb friction, 3.16 N of offset, 203.5 N s/m, 95.1 kg."""
    found = _found("emps")
    first, second = _named(found)[:2]
    assert first == "coulomb_friction" and second in OFFSET
    assert found.missing[0].at == "drive.v'"
    mass = found.tolerated["drive.mass"].value
    forces = {one.effect: mass * one.parameters["level"].value for one in found.missing if one.effect in FORCES}
    assert forces["coulomb_friction"] == pytest.approx(20.4, rel=0.1)
    assert forces["constant_disturbance"] == pytest.approx(3.16, rel=0.1)
    assert found.tolerated["drive.viscous"].value == pytest.approx(203.5, rel=0.05)
    assert _fall(found, "position") < 0.35


@measured
def test_emps_mass_is_the_published_one() -> None:
    """Published: 95.1 kg."""
    assert _found("emps").tolerated["drive.mass"].value == pytest.approx(95.1, rel=0.02)
