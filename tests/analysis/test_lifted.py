"""The exact discrete model against closed forms, the alias sum and a step-by-step simulation."""

import numpy as np
import pytest
from scipy.linalg import expm

from delaytools.linear.lifted import lift, why_not_liftable
from delaytools.linear.lifted_certificate import count_outside
from delaytools.linear.sampled_system import SampledSystem, Sampler
from delaytools.signals.trouble import AnalysisError
from tests.analysis.sampled_benches import T, holder, integrator_loop, roll_bench


def test_undelayed_integrator() -> None:
    # x[k+1] = x[k] - g T x[k]
    lifted = lift(integrator_loop((0.0,), (3.0,), 0.1))
    assert lifted is not None
    assert lifted.spectral_radius == pytest.approx(0.7, rel=1e-14)
    assert lifted.roots()[0] == pytest.approx(np.log(0.7) / 0.1, rel=1e-13)


@pytest.mark.parametrize("part", [0.0, 0.3, 0.999, 1.0, 1.4])
def test_delay_of_any_part_of_a_period(part: float) -> None:
    # x(kT - mT - fT) = x[k-m-1] + (1-f) T v[k-m-1]: z^(m+1) (z - 1) + g T ((1 - f) z^... + f) in closed form
    g, period = 2.0, 0.1
    m, f = int(part // 1), part % 1
    lifted = lift(integrator_loop((part * period,), (g,), period))
    # q[k] = x(kT - τ) = x[k-m] - f T v[k-m-1];  v = -g q;  (z - 1) X = T V
    # z^(m+1)(z - 1) + g T (z - f (z - 1)) = 0
    polynomial = np.zeros(m + 3)
    polynomial[[0, 1]] = 1.0, -1.0
    polynomial[-2:] += g * period * np.array([1 - f, f])
    expected = np.roots(polynomial)
    expected = expected[np.abs(expected) > 1e-9]
    found = lifted.multipliers[: len(expected)]
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(expected), rel=1e-9)


def test_copies_of_one_state_add_no_root_of_their_own() -> None:
    # v = -g (x[k] + x[k-1]): z^2 - z + g T (z + 1); a free second copy of the integrator would add z = 1
    g, period = 1.0, 0.1
    lifted = lift(integrator_loop((0.0, period), (g, g), period))
    expected = np.roots([1.0, g * period - 1.0, g * period])
    found = lifted.multipliers[np.abs(lifted.multipliers) > 1e-9]
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(expected), rel=1e-12)
    lifted = lift(integrator_loop((0.02, 0.07, 0.26), (g, g, g), period))
    assert lifted.spectral_radius < 0.999


def test_an_unstable_state_read_at_three_lags_has_one_root() -> None:
    # x' = a x + v, no feedback: e^{aT} once, whatever reads it
    M = np.zeros((5, 5))
    M[0, [0, 1]] = 0.7, 1.0
    M[1:4, 0] = 1.0
    M[4, 2:] = 1e-300
    system = SampledSystem(M, 1, (0.03, 0.11, 0.25), (holder(0.1, 0.0),), (), (), ("x",))
    lifted = lift(system)
    assert np.sum(np.abs(lifted.multipliers) > 1e-6) == 1
    assert lifted.multipliers[0] == pytest.approx(np.exp(0.07), rel=1e-14)


def test_pulse_transfer_is_the_alias_sum() -> None:
    # (1/T) Σ P(jω + jkω_s) H(jω + jkω_s), H = (1 - e^{-sT})/s; P falls as ω^-7
    omega = np.linspace(2.0, 628.0, 41)
    for tau in (0.0, 0.0031, 0.005, 0.0202):
        lifted = lift(roll_bench({"table": tau}, opened=True), {"e": T})
        found = -lifted.pulse(omega)[:, 0, 0]
        assert np.max(np.abs(found / aliased(omega, tau) - 1)) < 1e-11


def aliased(omega: np.ndarray, tau: float) -> np.ndarray:
    s = 1j * (omega[:, None] + np.arange(-400, 401) * 2 * np.pi / T)
    P = 180.0**2 / (s**2 + 216.0 * s + 180.0**2) * 900.0 / (s + 2.0) * np.exp(-s * tau)
    for wn, zeta in ((400.0, 0.7), (377.0, 0.6)):
        P = P * wn**2 / (s**2 + 2 * zeta * wn * s + wn**2)
    z = np.exp(1j * omega * T)
    rate = (P * (1 - np.exp(-s * T)) / s).sum(axis=1) / T
    return rate * (0.045 + 0.25 * T / (z - 1))


def simulated(table: float, held: np.ndarray) -> np.ndarray:
    """fin_command[k] of p03 opened there, by classical Runge-Kutta and a cubic history; table = n * 0.1 ms."""
    h = 1e-4
    n, shift = round(T / h), round(table / h)
    A = np.array(roll_bench(opened=True).block("x", "x"))
    A[5, 3] = 0.0
    x, history, answers, v = np.zeros(8), [], [], np.zeros(2)

    def delayed(index: int) -> tuple[float, float]:
        return history[index] if index >= 0 else (0.0, 0.0)

    for k in range(len(held)):
        v[0] = x[6]
        v[1] = -0.25 * x[0] - 0.045 * v[0]
        answers.append(v[1])
        drive = np.zeros(8)
        drive[0], drive[2] = v[0], 180.0**2 * held[k]
        for i in range(k * n, (k + 1) * n):
            history.append((x[3], (A @ x + drive)[3]))
            (a, da), (b, db) = delayed(i - shift), delayed(i - shift + 1) if shift > 0 else (0.0, 0.0)
            middle = 0.5 * (a + b) + h / 8 * (da - db)
            x = _step(A, x, drive, h, (a, middle, b))
    return np.array(answers)


def _step(A: np.ndarray, x: np.ndarray, drive: np.ndarray, h: float, read: tuple[float, ...]) -> np.ndarray:
    unit = np.zeros(8)
    unit[5] = 400.0**2
    k1 = A @ x + drive + unit * read[0]
    k2 = A @ (x + h / 2 * k1) + drive + unit * read[1]
    k3 = A @ (x + h / 2 * k2) + drive + unit * read[1]
    k4 = A @ (x + h * k3) + drive + unit * read[2]
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


@pytest.mark.parametrize("table", [0.0013, 0.005, 0.0202])
def test_response_is_the_simulated_one(table: float) -> None:
    held = np.concatenate([[1.0, -0.5, 2.0], np.zeros(37)])
    lifted = lift(roll_bench({"table": table}, opened=True), {"e": T})
    state, found = np.zeros(len(lifted.monodromy)), []
    for value in held:
        found.append((lifted.output_matrix @ state + lifted.feedthrough[:, 0] * value)[0])
        state = lifted.monodromy @ state + lifted.input_matrix[:, 0] * value
    expected = simulated(table, held)
    assert np.abs(expected).max() > 0.1
    assert found == pytest.approx(expected, abs=2e-6 * np.abs(expected).max())


def test_two_rates_against_composition_by_hand() -> None:
    # autopilot at 10 ms, rate sampler at 5 ms: two flows of 5 ms, the second tick without the autopilot
    lifted = lift(roll_bench(autopilot=2 * T))
    assert lifted.period == pytest.approx(2 * T)
    A, B = np.array(roll_bench().block("x", "x")), np.array(roll_bench().block("x", "v"))
    power = expm(np.block([[A * T, B * T], [np.zeros((2, 10))]]))
    flow, rate_tick, both_tick = power, np.eye(10), np.eye(10)
    rate_tick[8] = both_tick[8] = np.eye(10)[6]
    both_tick[9] = -0.25 * np.eye(10)[0] - 0.045 * np.eye(10)[6]
    expected = np.linalg.eigvals(flow @ rate_tick @ flow @ both_tick)
    assert lifted.spectral_radius == pytest.approx(np.abs(expected).max(), rel=1e-12)
    delayed = lift(roll_bench({"table": 1e-12}, autopilot=2 * T))
    assert delayed.spectral_radius == pytest.approx(lifted.spectral_radius, rel=1e-9)


def test_arrival_at_a_tick_reads_the_new_value() -> None:
    # v2(t) = v1(t - T) read at a tick is v1[k-1], not v1[k-2]: with v1 = 0.5 v2 the loop is z = 0.5
    M = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # z = v2; q1 = w; q2 = v1
    system = SampledSystem(M, 0, (0.1,), (holder(0.1, 0.5), holder(0.1)), (), (), ())
    assert lift(system).spectral_radius == pytest.approx(0.5, rel=1e-12)
    system = SampledSystem(M, 0, (0.2,), (holder(0.1, 0.5), holder(0.1)), (), (), ())
    assert lift(system).spectral_radius == pytest.approx(np.sqrt(0.5), rel=1e-12)


def test_sampler_with_states() -> None:
    # an accumulator ξ[k+1] = ξ + q with v = ξ around x' = -x + v: compared with the 2x2 closed form
    period, a = 0.2, np.exp(-0.2)
    accumulator = Sampler(period, [[1.0]], [[1.0]], [[1.0]], [[0.0]])
    M = np.array([[-1.0, 1.0], [-0.3, 0.0]])
    system = SampledSystem(M, 1, (), (accumulator,), (), (), ("x",))
    expected = np.linalg.eigvals(np.array([[a, 1 - a], [-0.3, 1.0]]))
    found = lift(system).multipliers
    assert np.sort_complex(found[np.abs(found) > 1e-9]) == pytest.approx(np.sort_complex(expected), rel=1e-12)


def test_what_cannot_be_lifted_says_why() -> None:
    M = np.array([[-1.0, 1.0, 1.0], [-0.5, 0.0, 0.0], [1.0, 0.0, 0.0]])  # x' = -x + v - 0.5 x(t - τ)
    system = SampledSystem(M, 1, (0.05,), (holder(0.1),), (), (), ("x",))
    assert lift(system) is None
    assert "continuous feedback cycle" in why_not_liftable(system)
    assert "common multiple" in why_not_liftable(roll_bench(autopilot=T * np.sqrt(2)))
    assert why_not_liftable(roll_bench({"table": 0.01})) == ""


def test_circle_of_sampled_blocks_is_an_error() -> None:
    M = np.array([[0.0, 1.0], [1.0, 0.0]])
    with pytest.raises(AnalysisError, match="algebraic loop"):
        lift(SampledSystem(M, 0, (), (holder(0.1), holder(0.1, 0.5)), (), (), ()))
    with pytest.raises(AnalysisError, match="no such input"):
        lift(roll_bench(), {"elevator": T})


@pytest.mark.parametrize(("tau", "outside"), [(0.0, 0), (0.0202, 0), (0.0203, 2), (0.030, 2)])
def test_certificate_counts_the_multipliers_outside(tau: float, outside: int) -> None:
    lifted = lift(roll_bench({"table": tau}))
    assert int(np.sum(np.abs(lifted.multipliers) > 1)) == outside
    assert count_outside(lifted.monodromy) == outside
