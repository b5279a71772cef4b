"""The algebra of linear systems with delay, tested two ways."""

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from delaytools.linear.algebra import append, delay, feedback, from_delay_differential, hold, parallel, series
from delaytools.linear.convert import from_control, to_control
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.evaluation import bordered_derivative
from delaytools.linear.pade import pade
from delaytools.signals.trouble import AnalysisError

S = np.array([0.3j, 1 + 2j, 7.0 - 1j, -0.4 + 3j, 25j])
P = ct.tf([1.0, 2.0], [1.0, 3.0, 5.0])
Q = ct.tf([2.0], [0.1, 1.0])
D = delay(0.3)


def close(left, right, tolerance=1e-14):
    return np.max(np.abs(left - right) / (1 + np.abs(right))) < tolerance


E, PV = np.exp(-0.3 * S), P(S)
OPERATIONS = {
    "delay * tf": (D * P, E * PV), "tf * delay": (P * D, E * PV),
    "delay * ss": (D * ct.ss(P), E * PV), "ss * delay": (ct.ss(P) * D, E * PV),
    "delay + tf": (D + P, E + PV), "tf + delay": (P + D, E + PV),
    "ss + delay": (ct.ss(P) + D, E + PV), "delay - tf": (D - P, E - PV),
    "tf - delay": (P - D, PV - E), "ss - delay": (ct.ss(P) - D, PV - E),
    "number * delay": (2 * D, 2 * E), "delay * numpy number": (D * np.float64(2), 2 * E),
    "numpy number * delay": (np.float64(2) * D, 2 * E), "array * delay": (np.array([[2.0]]) * D, 2 * E),
    "delay / number": (D / 4, E / 4), "1 - delay": (1 - D, 1 - E), "numpy - delay": (np.int64(1) - D, 1 - E),
    "-delay": (-D, -E), "series": (series(P, D), E * PV), "parallel": (parallel(P, D), PV + E),
    "feedback": (feedback(D * P), E * PV / (1 + E * PV)),
    "positive feedback by tf": (feedback(D, Q, 1), E / (1 - E * Q(S))),
    "hold": (hold(0.2), (1 - np.exp(-0.2 * S)) / (0.2 * S)),
}  # fmt: skip


@pytest.mark.parametrize("name", OPERATIONS)
def test_values(name):
    system, wanted = OPERATIONS[name]
    assert isinstance(system, DelaySystem)
    assert close(system.siso(S), wanted)
    assert close(system.siso(S.conj()), wanted.conj())


def test_feedback_two_ways():
    loop = feedback(D * P, Q)
    again = D * P * feedback(1, D * P * Q)
    assert close(loop.siso(S), again.siso(S))
    assert close(feedback(feedback(D * P, 2), 3).siso(S), feedback(D * P, 5).siso(S))


def test_mimo_two_ways():
    gain = np.array([[1.0, 2.0], [-0.5, 3.0]])
    plant = append(D * P, delay(0.7) * Q)
    left, right = gain * plant, plant * gain
    assert left(S).shape == (5, 2, 2)
    assert close(left(S), gain @ plant(S)) and close(right(S), plant(S) @ gain)
    closed = feedback(left)
    wanted = np.linalg.solve(np.eye(2) + left(S), left(S))
    assert close(closed(S), wanted, 1e-13)
    assert close(plant[1, 0].siso(S), 0 * S) and close(plant[1, 1].siso(S), np.exp(-0.7 * S) * Q(S))
    assert close((plant + 1)(S), plant(S) + np.ones((2, 2)))


def test_names():
    system = append(
        D.named(inputs=["command"], outputs=["rate"]), D.named(inputs=["command"], outputs=["angle"])
    )
    assert system.inputs == ("command", "command_2") and system.outputs == ("rate", "angle")
    part = system["angle", ["command_2", 0]]
    assert part.shape == (1, 2) and part.inputs == ("command_2", "command")
    assert append(D, D).inputs == ("u0", "u1")
    assert (P * D.named(inputs=["a"])).inputs == ("a",)
    with pytest.raises(AnalysisError, match="nearest: rate"):
        system["rte", 0]
    with pytest.raises(AnalysisError):
        system[5, 0]


@pytest.mark.parametrize(
    "wrong, words",
    [
        (lambda: delay(0.1, 2) * delay(0.1, 3), r"\(2, 2\) times one of shape \(3, 3\)"),
        (lambda: delay(0.1, 2) + delay(0.1), "shapes"),
        (lambda: feedback(delay(0.1, 2), delay(0.1)), "does not fit"),
        (lambda: feedback(1.0, 1.0, 1), "not well posed"),
        (lambda: feedback(delay(0.0), 1.0, 1).without_zero_delays(), "zero delay is not well posed"),
        (lambda: D * ct.tf([1], [1, 0.5], 0.1), "discrete"),
        (lambda: ct.tf([1], [1, 0.5], True) * D, "discrete"),
        (lambda: ct.ss(ct.tf([1], [1, 0.5], 0.1)) + D, "discrete"),
        (lambda: D * ct.tf([1, 0, 0], [1, 1]), "improper"),
        (lambda: D * 1j, "real"),
        (lambda: from_control("text"), "not a linear system"),
        (lambda: to_control(D), "pade"),
        (lambda: append(), "nothing"),
        (lambda: append(D, D).siso(1j), "one input"),
        (lambda: pade(D, 0), "order"),
        (lambda: D.with_spans([1, 2]), "spans"),
        (lambda: feedback(D, 1, 2), "sign"),
        (lambda: from_delay_differential([np.eye(2)], [0, 1]), "delay"),
    ],
)
def test_errors(wrong, words):
    with pytest.raises(AnalysisError, match=words):
        wrong()


def test_convert_there_and_back():
    mimo = ct.tf([[[1.0], [2.0, 1]], [[3.0], [1.0]]], [[[1.0, 1], [1.0, 2, 3]], [[1.0, 1], [1.0, 4]]])
    system = from_control(mimo)
    values = np.stack([mimo(s) for s in S])
    assert close(system(S), values, 1e-13)
    back = to_control(system)
    assert close(np.stack([back(s) for s in S]), values, 1e-13)
    assert to_control(delay(0.0) * P).nstates == 2
    assert system.n_states == 1 + 2 + 1  # equal denominators of a column share their states


def test_dcgain_and_poles():
    assert np.isclose((D * P).dcgain()[0, 0], 0.4)
    assert (D * ct.tf([1], [1, 0])).dcgain()[0, 0] == np.inf
    assert close(D.frequency_response([1.0, 2.0])[:, 0, 0], np.exp(-0.3j * np.array([1.0, 2.0])))


def test_characteristic_matrix_and_its_derivative():
    system = feedback(D * P * hold(0.2), delay(0.5))
    step = 1e-6
    for s in (1 + 2j, -2 + 1j):
        difference = (system.characteristic_matrix(s + step) - system.characteristic_matrix(s - step)) / (
            2 * step
        )
        assert np.allclose(bordered_derivative(system, s), difference, atol=1e-8)
    matrix = system.characteristic_matrix(1 + 2j)
    loop = 1 + np.exp(-0.8 * (1 + 2j)) * P(1 + 2j) * hold(0.2).siso(1 + 2j)
    den = np.polyval([1.0, 3.0, 5.0], 1 + 2j)
    assert np.isclose(np.linalg.det(matrix), loop * den, rtol=1e-13)


@pytest.mark.parametrize("s", [-3000.0 + 5j, 3000.0 + 5j])
def test_nothing_overflows_far_from_the_axis(s):
    """Closed loop: far left T -> -... of the delayed return alone, 1; far right the forward path."""
    with np.errstate(over="raise", invalid="raise"):
        closed = feedback(P * delay(1.0))
        value = closed.siso(s)
    assert np.isclose(value, 1.0 if s.real < 0 else 0.0, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 4, 8])
def test_pade_holds_as_far_as_it_says(order):
    for system in (D, hold(0.3), feedback(D * P)):
        found = pade(system, order)
        assert not found.system.channels and found.order == order and found.holds_to == 5.0 * order
        s = 0.1j * found.holds_to
        assert abs(found.system.siso(s) / system.siso(s) - 1) < (0.01 if order == 1 else 2e-4)
    phase = np.angle(pade(D, order).system.siso(1j * 5.0 * order) * np.exp(0.3j * 5.0 * order))
    assert 0.02 < abs(phase) < 0.25
    assert pade(from_control(P), 3).holds_to == np.inf


def test_from_delay_differential():
    matrices = [np.diag([1.0, 2, 3]), np.outer([1.0, 2, 3], [3.0, 0, 1]), np.eye(3)[[1, 0, 2]] * [1, 0, 1]]
    system = from_delay_differential(matrices, [0.0, 0.2, 0.7])
    assert system.n_channels == 1 + 2
    for s in (1 + 1j, 0.2j):
        wanted = np.linalg.det(
            sum((-m * np.exp(-s * t) for m, t in zip(matrices, [0, 0.2, 0.7], strict=True)), s * np.eye(3))
        )
        assert np.isclose(np.linalg.det(system.characteristic_matrix(s)), wanted, rtol=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.floats(0, 2), st.floats(0, 2))
def test_delays_in_series_add_and_commute(first, second):
    one_way, other_way, sum_of_both = (
        delay(first) * delay(second),
        delay(second) * delay(first),
        delay(first + second),
    )
    assert close(one_way.siso(S[:3]), sum_of_both.siso(S[:3]))
    assert close(one_way.siso(S[:3]), other_way.siso(S[:3]))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.01, 1.0))
def test_random_loops_two_ways(seed, tau):
    generator = np.random.default_rng(seed)
    ss = ct.ss(generator.normal(size=(3, 3)), generator.normal(size=(3, 2)), generator.normal(size=(2, 3)), 0)
    loop = delay(tau, 2) * ss
    points = S[:3] + 5
    values = np.stack([np.exp(-s * tau) * ss(s) for s in points])
    assert close(loop(points), values, 1e-12)
    assert close(feedback(loop)(points), np.linalg.solve(np.eye(2) + values, values), 1e-12)
