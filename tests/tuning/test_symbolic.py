"""L(jω) with symbols: the numbers of the numeric linear system, and derivatives that are those of differences."""

from collections.abc import Sequence

import casadi as ca
import numpy as np
import pytest

from delaytools.blocks.delay import Delay
from delaytools.blocks.sample_hold import SampleHold
from delaytools.blocks.second_order import SecondOrder
from delaytools.compensators.inverse import InverseCompensator
from delaytools.linear.hold_approximation import continuous_approximation
from delaytools.loop.edit import cut, reader
from delaytools.loop.linearise import linearise
from delaytools.loop.loop import Loop
from delaytools.loop.symbolic import nominal_values, symbolic_response
from delaytools.loop.values import resolve
from delaytools.signals.trouble import AnalysisError, DesignError
from tests.simulation.benches import element, late, rate_loop, roll_bench, turntable, with_block


def path(loop: Loop, start: str, name: str) -> str:
    """The path of a value of the element whose name begins with `start`."""
    return next(f"{e.path}.{name}" for e in loop.elements if e.name.startswith(start))


def compensated_bench() -> tuple[Loop, list[str], list[float]]:
    """Delays of the table and of the held command, the compensator before the table."""
    compensator = InverseCompensator(alpha=16.0, period=1e-3)
    loop = with_block(late("motion_table.input", 0.015), "motion_table.input", compensator)
    loop = with_block(loop, "actuator.input", Delay(delay=0.003))
    free = [path(loop, *pair) for pair in (("Delay@m", "delay"), ("Inverse", "alpha"), ("Delay@a", "delay"))]
    return loop, ["parameters.kp", "actuator.damping", *free], [0.05, 0.55, 0.0143, 12.0, 0.002]


def two_rates() -> tuple[Loop, list[str], list[float]]:
    loop = with_block(roll_bench(2e-3), "autopilot.output", SampleHold(period=3e-3))
    return loop, ["parameters.kphi", "gyro.natural_frequency"], [0.3, 300.0]


def unsampled() -> tuple[Loop, list[str], list[float]]:
    return rate_loop(0.015), ["gain.gain", "transport.delay"], [33.0, 0.02]


CASES = {
    "compensated": (compensated_bench, "fin_command"),
    "two rates": (two_rates, "roll_rate"),
    "unsampled": (unsampled, "y"),
    "sequence": (compensated_bench, "sampled_rate"),
}


def numeric(loop: Loop, free: Sequence[str], values: Sequence[float], at: str, omega: np.ndarray) -> np.ndarray:
    fixed = resolve(loop, dict(zip(free, values, strict=True)))
    return continuous_approximation(linearise(fixed, [reader(at)], [at]).system).siso(1j * omega)


@pytest.mark.parametrize("name", CASES)
def test_equals_the_numeric_system(name: str) -> None:
    make, at = CASES[name]
    loop, free, values = make()
    loop = cut(loop, at)
    omega = np.exp(np.random.default_rng(1).uniform(-2, 6.5, 200))
    function = symbolic_response(loop, reader(at), at, free=free)
    re, im = function.map(200)(omega[None, :], np.tile(np.array(values)[:, None], 200))
    found = np.asarray(re).ravel() + 1j * np.asarray(im).ravel()
    expected = numeric(loop, free, values, at, omega)
    assert np.max(np.abs(found - expected) / np.abs(expected)) < 1e-10


@pytest.mark.parametrize("name", CASES)
def test_derivative_is_that_of_differences(name: str) -> None:
    make, at = CASES[name]
    loop, free, values = make()
    function = symbolic_response(cut(loop, at), reader(at), at, free=free)
    omega, p = ca.MX.sym("omega"), ca.MX.sym("p", len(free))
    exact = ca.Function("J", [omega, p], [ca.jacobian(ca.vertcat(*function(omega, p)), p)])
    for w in (3.0, 40.0, 170.0):
        slope = np.asarray(exact(w, values))
        for k, value in enumerate(values):
            step = np.eye(len(values))[k] * 1e-5 * value
            up, down = (np.array(function(w, values + sign * step)).ravel() for sign in (1, -1))
            difference = (up - down) / (2e-5 * value)
            assert slope[:, k] == pytest.approx(difference, rel=1e-5, abs=1e-7 * np.abs(slope[:, k]).max() + 1e-12)


def test_nominal_values_of_what_is_neutral() -> None:
    loop = with_block(roll_bench(), "motion_table.input", InverseCompensator(alpha=1.0, period=1e-3))
    alpha = path(loop, "Inverse", "alpha")
    assert nominal_values(loop, [alpha, "parameters.kp"]) == {alpha: 1.0, "parameters.kp": 0.045}
    with pytest.raises(DesignError, match="no such value"):
        nominal_values(loop, ["actuator.dampin"])


def test_a_nonlinear_loop_at_rest() -> None:
    """The turntable with friction: differentiated at rest, the friction a steep slope there."""
    loop = cut(turntable(), "command")
    free, values = ["parameters.kp"], [0.7]
    omega = np.array([2.0, 20.0, 200.0])
    function = symbolic_response(loop, reader("command"), "command", free=free)
    found = [complex(*(float(part) for part in function(w, values))) for w in omega]
    assert found == pytest.approx(numeric(loop, free, values, "command", omega), rel=1e-10)


def test_unknown_names() -> None:
    loop = cut(rate_loop(0.01), "y")
    with pytest.raises(DesignError, match="not an external input"):
        symbolic_response(loop, "nothing", "y", free=["gain.gain"])
    with pytest.raises((DesignError, AnalysisError), match="no such value"):
        symbolic_response(loop, reader("y"), "y", free=["gain.gian"])


def test_a_wire_alone() -> None:
    loop = Loop((element("sensor", SecondOrder(natural_frequency=50.0, damping=0.7), "u", "y"),))
    function = symbolic_response(loop, "u", "y", free=["sensor.damping"])
    assert complex(*(float(x) for x in function(50.0, [0.4]))) == pytest.approx(1 / 0.8j, rel=1e-12)
