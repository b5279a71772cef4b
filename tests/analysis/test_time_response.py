"""Time responses: exact polynomials, another method's digits, and what linear systems owe."""

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from delaytools.analysis.time_response import (
    forced_response,
    impulse_response,
    initial_response,
    step_response,
)
from delaytools.linear.algebra import delay, feedback, hold
from delaytools.linear.delay_system import as_delay_system
from delaytools.signals.trouble import AnalysisError

PLANT = ct.tf([3 * 14050.0], np.polymul([1.0, 17.86, 14050.0], [0.5, 1.0]))


def test_the_exact_pieces_of_a_delayed_integrator() -> None:
    """feedback(2 e^{-s}/s, 1): 0, then 2(t-1), then 2(t-1) - 2(t-2)² (ControlSystems.jl test_delay_timeresp.jl)."""
    t = np.linspace(0.0, 3.0, 301)
    found = step_response(feedback(2 * delay(1.0) * ct.tf([1.0], [1.0, 0.0])), t)
    exact = np.where(t < 1, 0.0, 2 * (t - 1)) - np.where(t > 2, 2 * (t - 2) ** 2, 0.0)
    assert np.abs(found.y[0, 0] - exact).max() < 1e-12


def test_the_thesis_loop_at_one_second() -> None:
    t = np.array([0.0, 0.5, 1.02, 20.0])
    found = step_response(feedback(delay(0.02) * PLANT), t).y[0, 0]
    assert found[2] == pytest.approx(0.749927348677233, abs=1e-10)
    assert found[3] == pytest.approx(0.75, abs=1e-12)


def test_without_delay_it_is_what_python_control_gives() -> None:
    system = ct.tf([2.0, 3.0], [1.0, 0.4, 4.0])
    t = np.linspace(0.0, 12.0, 241)
    assert step_response(system, t).y[0, 0] == pytest.approx(ct.step_response(system, t).y[0, 0], abs=1e-9)
    found = impulse_response(system, t).y[0, 0]
    assert found == pytest.approx(ct.impulse_response(system, t).y[0, 0], abs=1e-9)
    info = ct.step_info(step_response(system, t).y[0, 0], T=t)
    assert info["Overshoot"] > 0


def test_several_delays_that_have_no_common_measure() -> None:
    """x' = -x(t) - 0.5 x(t-1) - 0.7 x(t-√2/2) + u by Heun's steps of 1 ms."""
    back = 1.0 + 0.5 * delay(1.0) + 0.7 * delay(np.sqrt(2) / 2)
    t = np.linspace(0.0, 4.0, 9)
    found = step_response(feedback(as_delay_system(ct.tf([1.0], [1.0, 0.0])), back), t).y[0, 0]
    h, late = 1e-3, (1.0, np.sqrt(2) / 2)
    x = np.zeros(round(4.0 / h) + 1)
    grid = h * np.arange(len(x))
    for k in range(len(x) - 1):
        def rate(value: float, time: float, known: int) -> float:
            past = [np.interp(time - tau, grid[: known + 1], x[: known + 1]) if time > tau else 0.0 for tau in late]
            return 1.0 - value - 0.5 * past[0] - 0.7 * past[1]
        first = rate(x[k], grid[k], k)
        x[k + 1] = x[k] + h / 2 * (first + rate(x[k] + h * first, grid[k + 1], k))
    assert found == pytest.approx(np.interp(t, grid, x), abs=1e-6)


@given(tau=st.floats(0.05, 1.5), scale=st.floats(0.2, 5.0))
@settings(max_examples=10, deadline=None)
def test_time_scales(tau: float, scale: float) -> None:
    t = np.linspace(0.0, 6.0, 61)
    plain = step_response(feedback(0.8 * delay(tau) * ct.tf([1.0], [1.0, 1.0])), t).y[0, 0]
    slow = step_response(feedback(0.8 * delay(tau * scale) * ct.tf([1.0], [scale, 1.0])), t * scale).y[0, 0]
    assert slow == pytest.approx(plain, abs=1e-11)


@given(first=st.floats(0.01, 1.0), second=st.floats(0.01, 1.0))
@settings(max_examples=10, deadline=None)
def test_delays_in_a_row_commute_and_add(first: float, second: float) -> None:
    lag, t = as_delay_system(ct.tf([1.0], [0.3, 1.0])), np.linspace(0.0, 5.0, 101)
    one = step_response(delay(first) * lag * delay(second), t).y[0, 0]
    other = step_response(delay(first + second) * lag, t).y[0, 0]
    assert one == pytest.approx(other, abs=1e-12)
    exact = np.where(t > first + second, 1 - np.exp(-np.maximum(t - first - second, 0.0) / 0.3), 0.0)
    assert one == pytest.approx(exact, abs=1e-12)


def test_a_jump_that_passes_straight_through_a_loop() -> None:
    """y = u + 0.5 y(t - 0.3): 1, 1.5, 1.75, ... in steps."""
    t = np.array([0.0, 0.29, 0.31, 0.59, 0.61, 0.91])
    assert step_response(feedback(as_delay_system(1.0), -0.5 * delay(0.3)), t).y[0, 0] == pytest.approx(
        [1.0, 1.0, 1.5, 1.5, 1.75, 1.875], abs=1e-13
    )


def test_a_hold_is_the_mean_over_its_period() -> None:
    t = np.linspace(0.0, 1.0, 41)
    assert step_response(hold(0.25), t).y[0, 0] == pytest.approx(np.minimum(t / 0.25, 1.0), abs=1e-12)


def test_forced_by_straight_lines_is_the_sum_of_ramps() -> None:
    loop = feedback(0.8 * delay(0.4) * ct.tf([1.0], [0.5, 1.0]))
    t = np.linspace(0.0, 4.0, 81)
    wave = np.interp(t, [0.0, 1.0, 1.5, 4.0], [0.0, 2.0, -1.0, -1.0])
    ramp = forced_response(loop, t, t).y[0]
    late = [np.concatenate([np.zeros(k), ramp[: len(t) - k]]) for k in (0, 20, 30)]
    assert forced_response(loop, t, wave).y[0] == pytest.approx(2 * late[0] - 8 * late[1] + 6 * late[2], abs=1e-11)


def test_an_impulse_through_delays_is_the_slope_of_the_step() -> None:
    loop = feedback(0.8 * delay(0.4) * ct.tf([1.0, 3.0], [0.5, 1.2, 1.0]))
    t, h = np.linspace(0.13, 5.03, 50), 1e-4
    step = step_response(loop, np.concatenate([[0.0], np.sort(np.concatenate([t - h, t + h]))])).y[0, 0, 1:]
    impulse = impulse_response(loop, np.concatenate([[0.0], t])).y[0, 0, 1:]
    assert impulse == pytest.approx((step[1::2] - step[::2]) / (2 * h), abs=1e-6)


def test_units_of_time_do_not_matter() -> None:
    """The same loop in microseconds: elements of 1e-7 s are told apart as those of 0.1 s are."""
    t = np.linspace(0.0, 5.0, 41)
    plain = step_response(feedback(0.8 * delay(0.37) * ct.tf([1.0], [0.5, 1.0])), t).y[0, 0]
    quick = step_response(feedback(0.8 * delay(0.37e-6) * ct.tf([1.0], [0.5e-6, 1.0])), t * 1e-6).y[0, 0]
    assert quick == pytest.approx(plain, abs=1e-11)


def test_from_a_state() -> None:
    t = np.linspace(0.0, 2.0, 21)
    found = initial_response(ct.ss([[-2.0]], [[1.0]], [[3.0]], [[0.0]]), t, [1.5]).y[0]
    assert found == pytest.approx(4.5 * np.exp(-2 * t), abs=1e-13)


def test_what_cannot_be_asked() -> None:
    with pytest.raises(AnalysisError, match="rise from 0"):
        step_response(ct.tf([1.0], [1.0, 1.0]), [1.0, 2.0])
    with pytest.raises(AnalysisError, match="straight through"):
        impulse_response(ct.tf([1.0, 1.0], [1.0, 2.0]), [0.0, 1.0])
    with pytest.raises(AnalysisError, match="no such input"):
        step_response(ct.tf([1.0], [1.0, 1.0]), [0.0, 1.0], input="stick")
    with pytest.raises(AnalysisError, match="for each rational state"):
        initial_response(ct.tf([1.0], [1.0, 1.0]), [0.0, 1.0], [1.0, 2.0])
