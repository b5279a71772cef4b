"""Effects on derivatives against SciPy: the element alone, integrated a second time from its written formula."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from delaytools.blocks.first_order import FirstOrder
from delaytools.blocks.second_order import SecondOrder
from delaytools.effects.coulomb_friction import CoulombFrictionEffect
from delaytools.effects.cubic_damping import CubicDampingEffect
from delaytools.effects.load_dependent_friction import LoadDependentFrictionEffect
from delaytools.effects.rate_limit import RateLimitEffect
from tests.effects.family import DERIVATIVE
from tests.effects.servo import DAMPING, FREQUENCY, alone, drive, placed, rows

Array = NDArray[np.float64]
ALONE = SecondOrder(natural_frequency=FREQUENCY, damping=DAMPING)


def demand(t: float) -> float:
    """What drives the element."""
    return float(np.sin(2 * np.pi * 1.3 * t))


def gust(t: float) -> float:
    """The other signal."""
    return float(0.7 * np.sin(2 * np.pi * 2.1 * t + 0.4))


def spring(t: float, x: float, v: float) -> float:
    """v' of the element itself: ωn² (u - x) - 2 ζ ωn v."""
    return FREQUENCY**2 * (demand(t) - x) - 2 * DAMPING * FREQUENCY * v


# name: what is added to v', from t, x, v
TERMS: dict[str, Callable[[float, float, float], float]] = {
    "constant disturbance": lambda t, x, v: 150.0,
    "coulomb friction": lambda t, x, v: -120.0 * np.tanh(v / 0.5),
    "stribeck friction": lambda t, x, v: -(80.0 + 80.0 * np.exp(-((v / 2.0) ** 2))) * np.tanh(v / 0.5),
    "load-dependent friction": lambda t, x, v: -0.2 * abs(spring(t, x, v)) * np.tanh(v / 0.5),
    "cubic stiffness": lambda t, x, v: -300.0 * x**3,
    "cubic damping": lambda t, x, v: -0.5 * v**3,
    "quadratic drag": lambda t, x, v: -3.0 * v * abs(v),
    "coupling of moments": lambda t, x, v: 200.0 * gust(t),
    "formula of position and rate": lambda t, x, v: -20.0 * x * abs(v) + 90.0 * gust(t) * np.cos(t),
}


def integrated(rates: Callable, t: Array) -> Array:
    """States at t from rest."""
    return solve_ivp(rates, (0, t[-1]), [0.0, 0.0], "Radau", t, rtol=1e-10, atol=1e-12, max_step=0.002).y


@pytest.mark.parametrize("name", DERIVATIVE)
def test_a_second_order_element(name: str) -> None:
    run = rows(placed(alone(ALONE), DERIVATIVE[name], "actuator.rate'"), substeps=4)
    term = TERMS[name]
    x, _ = integrated(lambda t, s: [s[1], spring(t, *s) + term(t, *s)], run["t"])
    assert np.max(np.abs(run["position"] - x)) < 1e-6 * np.max(np.abs(x))


def test_equations_show_position_and_speed() -> None:
    run = rows(placed(drive(), DERIVATIVE["cubic stiffness"], "drive.v'"), substeps=4)

    def rates(t: float, s: Array) -> list[float]:
        return [s[1], (demand(t) - 0.2 * s[1]) / 0.05 - 300.0 * s[0] ** 3]

    x, v = integrated(rates, run["t"])
    assert np.max(np.abs(run["position"] - x)) < 1e-6 * np.max(np.abs(x))
    assert np.max(np.abs(run["speed"] - v)) < 1e-6 * np.max(np.abs(v))


def test_a_first_order_state_is_its_own_rate() -> None:
    loop = placed(
        alone(FirstOrder(time_constant=0.05)), CubicDampingEffect(coefficient=-40.0), "actuator.output'"
    )
    run = rows(loop, substeps=4)
    x, _ = integrated(lambda t, s: [(demand(t) - s[0]) / 0.05 - 40.0 * s[0] ** 3, 0.0], run["t"])
    assert np.max(np.abs(run["position"] - x)) < 1e-6 * np.max(np.abs(x))


def test_load_is_what_is_no_friction() -> None:
    """Load friction counts neither itself nor the Coulomb friction that stands before it."""
    coulomb = CoulombFrictionEffect(level=60.0, smoothing=0.5)
    loaded = LoadDependentFrictionEffect(coefficient=0.2, smoothing=0.5)
    loop = placed(placed(alone(ALONE), coulomb, "actuator.rate'"), loaded, "actuator.rate'", 1)
    loop = placed(loop, DERIVATIVE["constant disturbance"], "actuator.rate'", 2)
    run = rows(loop, substeps=4)

    def rates(t: float, s: Array) -> list[float]:
        load = spring(t, *s) + 150.0
        return [s[1], load - (60.0 + 0.2 * abs(load)) * np.tanh(s[1] / 0.5)]

    x, _ = integrated(rates, run["t"])
    assert np.max(np.abs(run["position"] - x)) < 1e-6 * np.max(np.abs(x))


def limited(limit: float, end: float, step: float) -> tuple[Array, Array]:
    """t and x of the element with limited speed: the written formula in Heun steps, v kept at the limit exactly."""
    x = v = 0.0
    found = []
    for t in step * np.arange(round(end / step) + 1):
        found.append(x)
        first = spring(t, x, v)
        guess = min(max(v + step * first, -limit), limit)
        second = spring(t + step, x + step * v, guess)
        new = min(max(v + step * (first + second) / 2, -limit), limit)
        x, v = x + step * (v + new) / 2, new
    return step * np.arange(len(found)), np.array(found)


@pytest.mark.parametrize(("substeps", "allowed"), [(1, 1e-4), (10, 2e-6)])
def test_an_element_with_limited_speed(substeps: int, allowed: float) -> None:
    run = rows(placed(alone(ALONE), RateLimitEffect(limit=5.0), "actuator.rate"), substeps=substeps)
    t, x = limited(5.0, run["t"][-1], 1e-5)
    speed = np.abs(np.gradient(run["position"], run["t"]))
    assert np.max(speed) < 5.0 + 1e-9 and np.sum(speed > 5.0 - 1e-6) > 300
    assert np.max(np.abs(run["position"] - np.interp(run["t"], t, x))) < allowed
