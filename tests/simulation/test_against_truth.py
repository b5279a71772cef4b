"""The compiled step against an independent simulator (collocation and DOP853 by the method of steps)."""

import numpy as np
import pytest

from delaytools.simulation.simulate import simulate
from tests.simulation.benches import CASES, STEP, delayed_integrator
from tests.truth import problems

LINEAR = [name for name in CASES if name != "turntable"]


def worst_error(name: str, substeps: int) -> float:
    """Largest error over all signals and rows, as a share of each signal's full scale."""
    loop, stimuli = CASES[name]
    truth = problems.reference(name)
    time = np.asarray(truth["time"])
    run = simulate(loop, stimuli, duration=float(time[-1]), substeps=substeps).record
    shared = [signal for signal in run.names if signal in truth]
    assert len(shared) >= 1
    errors = []
    for signal in shared:
        expected = np.asarray(truth[signal])
        errors.append(np.max(np.abs(run[signal] - expected)) / np.max(np.abs(expected)))
    return float(max(errors))


@pytest.mark.parametrize("name", LINEAR)
def test_error_at_the_1_ms_frame(name: str) -> None:
    """One step per 1 ms frame: at most 1e-5 of full scale, held and delayed held signals included."""
    assert worst_error(name, 1) <= 1e-5


@pytest.mark.parametrize("name", LINEAR)
def test_error_at_an_eighth_of_the_frame(name: str) -> None:
    """Steps of 1/8 ms: at most 1e-8 of full scale."""
    assert worst_error(name, 8) <= 1e-8


@pytest.mark.parametrize("name", LINEAR)
def test_order_of_convergence_is_four(name: str) -> None:
    """Halving the step divides the error by about 16, across ticks and arriving jumps too."""
    coarse, fine = worst_error(name, 2), worst_error(name, 4)
    assert np.log2(coarse / fine) >= 3.6


def test_turntable_with_friction() -> None:
    """A smooth but stiff nonlinearity: converges, and the step chosen by the package is good to 1e-5."""
    assert worst_error("turntable", 8) <= 1e-6


def test_delayed_integrator_is_exact() -> None:
    """Piecewise polynomials of degree 3 are followed to rounding (ControlSystems.jl test_delay_timeresp.jl)."""
    run = simulate(delayed_integrator(), STEP, duration=3.0).record
    t = run.time
    first = 2 * (t - 1) * (t >= 1)
    expected = np.where(t >= 2, first - 2 * (t - 2) ** 2, first)
    assert np.max(np.abs(run["y"] - expected)) < 1e-12


def test_published_value_of_the_resonance_loop() -> None:
    """y = 0.749927348677 one second after the output can first move; two methods of the source agree to 6e-11."""
    loop, stimuli = CASES["resonance loop"]
    run = simulate(loop, stimuli, duration=1.02, substeps=16).record
    assert run["y"][-1] == pytest.approx(0.749927348677, abs=2e-9)
