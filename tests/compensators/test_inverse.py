"""The inverse compensator against its published and computed facts, by its linear form and by running it."""

import math

import numpy as np
import pytest

from delaytools.blocks.gain import Gain
from delaytools.blocks.lag import Lag
from delaytools.blocks.sample_hold import SampleHold
from delaytools.compensators.inverse import InverseCompensator, alpha_for
from delaytools.linear.sampled_system import Sampler
from delaytools.loop.linearise import linearise
from delaytools.loop.loop import Loop
from delaytools.loop.values import resolve
from delaytools.signals.stimulus import Column, Sine
from delaytools.signals.trouble import DesignError
from delaytools.simulation.simulate import simulate
from tests.simulation.benches import element

FRAME, STEPS = 1e-3, 15
ALPHA = STEPS + 1.0
# frequency Hz, lead deg, |C|: shared/oracles/compensators.md, "thesis compensator (16, -15) at 1 ms"
TABLE = ((5, 25.07, 1.112), (7, 33.03, 1.210), (9, 39.62, 1.329), (15, 52.93, 1.769), (60, 69.6, 5.891))


def alone(alpha: float = ALPHA) -> Loop:
    return Loop((element("compensator", InverseCompensator(alpha=alpha, period=FRAME), "u", "y"),))


def sampler() -> Sampler:
    return linearise(alone(), ["u"], ["y"]).system.samplers[0]


def pulse(omega: np.ndarray) -> np.ndarray:
    s = sampler()
    z = np.exp(1j * omega * FRAME)
    return s.D[0, 0] + s.H[0, 0] * s.G[0, 0] / (z - s.F[0, 0])


def sequence(values: np.ndarray, loop: Loop) -> np.ndarray:
    """y at the ticks, for the given values of u at the ticks."""
    t = FRAME * np.arange(len(values))
    record = simulate(loop, {"u": Column(time=t, values=values)}, duration=float(t[-1]), substeps=8).record
    return record["y"]


def test_alpha_of_the_thesis() -> None:
    assert alpha_for(15e-3, 1e-3) == pytest.approx(16.0)
    with pytest.raises(DesignError, match="period above 0"):
        alpha_for(15e-3, 0.0)


def test_linear_form_is_the_equation() -> None:
    s = sampler()
    assert (s.F, s.G, s.H, s.D) == (0.0, 1.0, -15.0, 16.0)
    assert s.period == FRAME


def test_run_is_the_equation() -> None:
    u = np.random.default_rng(1).standard_normal(300)
    expected = ALPHA * u - (ALPHA - 1) * np.append(0.0, u[:-1])
    assert sequence(u, alone()) == pytest.approx(expected, abs=1e-11)


def test_squared_gain() -> None:
    omega = np.linspace(1.0, math.pi / FRAME, 500)
    formula = 1 + 4 * STEPS * (STEPS + 1) * np.sin(omega * FRAME / 2) ** 2
    assert np.abs(pulse(omega)) ** 2 == pytest.approx(formula, rel=1e-12)


def test_largest_lead() -> None:
    omega = np.linspace(1.0, math.pi / FRAME, 400_001)
    assert np.angle(pulse(omega)).max() == pytest.approx(math.asin(STEPS / (STEPS + 1)), abs=1e-9)
    assert math.degrees(math.asin(STEPS / (STEPS + 1))) == pytest.approx(69.6, abs=0.05)


@pytest.mark.parametrize(("hertz", "lead", "gain"), TABLE)
def test_table_by_linear_form(hertz: float, lead: float, gain: float) -> None:
    value = pulse(np.array([2 * math.pi * hertz]))[0]
    assert math.degrees(np.angle(value)) == pytest.approx(lead, abs=0.05)
    assert abs(value) == pytest.approx(gain, abs=6e-4)


@pytest.mark.parametrize(("hertz", "lead", "gain"), TABLE)
def test_table_by_running(hertz: float, lead: float, gain: float) -> None:
    run = simulate(alone(), {"u": Sine(amplitude=1.0, frequency=hertz)}, duration=1.0).record
    t, y = run.time[10:], run["y"][10:]
    basis = np.stack([np.sin(2 * math.pi * hertz * t), np.cos(2 * math.pi * hertz * t)], axis=1)
    a, b = np.linalg.lstsq(basis, y, rcond=None)[0]
    assert math.degrees(math.atan2(b, a)) == pytest.approx(lead, abs=0.05)
    assert math.hypot(a, b) == pytest.approx(gain, abs=6e-4)


def test_white_noise_gain() -> None:
    formula = math.sqrt((1 + STEPS) ** 2 + STEPS**2)
    assert formula == pytest.approx(21.93, abs=5e-3)
    omega = math.pi / FRAME * (np.arange(64) + 0.5) / 64
    assert math.sqrt(np.mean(np.abs(pulse(omega)) ** 2)) == pytest.approx(formula, rel=1e-12)
    u = np.random.default_rng(3).standard_normal(20_000)
    assert np.std(sequence(u, alone())) == pytest.approx(formula, rel=0.03)


def test_inverts_a_lag_exactly() -> None:
    """A held sequence through the lag of 15.49 ms and the compensator is the sequence one frame later."""
    constant = -FRAME / math.log(1 - 1 / ALPHA)
    assert constant == pytest.approx(15.49e-3, abs=5e-6)
    loop = Loop(
        (
            element("hold", SampleHold(period=FRAME), "u", "held"),
            element("lag", Lag(time_constant=constant), "held", "late"),
            element("compensator", InverseCompensator(alpha=ALPHA, period=FRAME), "late", "y"),
        )
    )
    u = np.random.default_rng(2).standard_normal(200)
    assert sequence(u, loop)[1:] == pytest.approx(u[:-1], abs=1e-9)


def test_better_than_nothing_below_19_hertz_only() -> None:
    hertz = np.linspace(1, 40, 20_000)
    omega = 2 * math.pi * hertz
    late = np.exp(-1j * omega * 15e-3)
    worse = np.abs(1 - pulse(omega) * late) > np.abs(1 - late)
    assert hertz[np.argmax(worse)] == pytest.approx(19.1, abs=0.05)


def test_neutral_is_a_wire() -> None:
    assert isinstance(resolve(alone(1.0))["compensator"].block, Gain)
