"""Sampled systems as records, and their continuous approximation: where the hold is charged."""

import numpy as np
import pytest

from delaytools.linear.channel import Hold
from delaytools.linear.hold_approximation import continuous_approximation
from delaytools.linear.sampled_system import SampledSystem, Sampler
from delaytools.signals.trouble import AnalysisError

S = np.array([0.3j, 1 + 2j, -0.5 + 4j])
T, TAU, GAIN = 0.1, 0.05, 2.0
STATIC = Sampler(T, [], [], [], [[GAIN]])
HELD, LATE = Hold(T).value(S), np.exp(-TAU * S)


def system(M, samplers, *, delays=(), outputs=("y",), n=1):
    names = tuple(f"x{i}" for i in range(n))
    return SampledSystem(np.array(M, dtype=float), n, delays, samplers, ("e",), outputs, names)


def test_blocks_and_sizes():
    M = np.arange(16.0).reshape(4, 4)
    sampled = system(M, (STATIC,), delays=(TAU,))
    assert sampled.block("x", "v") == [[1.0]] and sampled.block("y", "e") == [[15.0]]
    assert sampled.rows("q") == slice(2, 3) and sampled.columns("w") == slice(2, 3)
    assert sampled.row_sizes == {"x": 1, "z": 1, "q": 1, "y": 1}
    assert (STATIC.n_states, STATIC.n_inputs, STATIC.n_outputs) == (0, 1, 1)
    with pytest.raises(ValueError):
        sampled.M[0, 0] = 1.0


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: system(np.eye(3), (STATIC,), delays=(TAU,)),
        lambda: system(np.eye(4), (STATIC,), delays=(-1.0,)),
        lambda: Sampler(0.0, [], [], [], [[1.0]]),
        lambda: Sampler(T, [[1.0]], [[1.0, 2.0]], [[1.0]], [[0.0]]),
        lambda: system(np.full((4, 4), np.nan), (STATIC,), delays=(TAU,)),
    ],
)
def test_errors(wrong):
    with pytest.raises(AnalysisError):
        wrong()


def test_held_once_where_the_plant_reads_a_delayed_held_signal():
    """x' = w, w = v(t - tau), v = K (e - x): rows x', z, q, y; columns x, v, w, e."""
    found = continuous_approximation(
        system([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 1], [1, 0, 0, 0]], (STATIC,), delays=(TAU,))
    )
    loop = GAIN * LATE * HELD / S
    assert np.allclose(found.siso(S), loop / (1 + loop), rtol=1e-13)


def test_no_hold_where_a_sampler_reads_a_delayed_held_signal():
    """v1 = K e held, delayed to w, read by v2 = K w, then x' = v2: one hold only."""
    M = [[0, 0, 1, 0, 0], [0, 1, 0, 0, 0], [0, 0, 0, 0, 1], [0, 0, 0, 1, 0], [1, 0, 0, 0, 0]]
    found = continuous_approximation(system(M, (STATIC, STATIC), delays=(TAU,)))
    assert np.allclose(found.siso(S), GAIN**2 * LATE * HELD / S, rtol=1e-13)


def test_transport_that_mixes_in_the_state_carries_the_held_signal():
    """w = (v + x)(t - tau), q = w + e, y = x, x' = v: both readings of w hold v."""
    M = [[0, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 1], [1, 0, 0, 0]]
    found = continuous_approximation(system(M, (STATIC,), delays=(TAU,)))
    # x = K q H/s, w = L (H K q + x), q = w + e
    q = 1 / (1 - LATE * HELD * GAIN * (1 + 1 / S))
    assert np.allclose(found.siso(S), GAIN * HELD / S * q, rtol=1e-12)


def test_outputs_sequence_raw_and_mixed_held():
    M = [[0, 1, 0], [0, 0, 1], [0, 1, 0], [1, 1, 0]]
    found = continuous_approximation(system(M, (STATIC,), outputs=("command", "sum")))
    values = found(S)[..., 0]
    assert np.allclose(values[:, 0], GAIN, rtol=1e-14)
    assert np.allclose(values[:, 1], GAIN * HELD * (1 + 1 / S), rtol=1e-13)


def test_sampler_with_states_is_exact_in_z():
    """C(z) = H (z - F)^-1 G + D at z = e^{sT}, and the hold where y mixes it with e."""
    sampler = Sampler(T, [[0.9, 0.1], [0.0, 0.5]], [[0.2], [1.0]], [[1.0, -1.0]], [[0.3]])
    found = continuous_approximation(system([[-1, 1, 0], [0, 0, 1], [1, 0, 0]], (sampler,)))
    z = np.exp(S * T)
    C = np.array(
        [(sampler.H @ np.linalg.solve(k * np.eye(2) - sampler.F, sampler.G) + sampler.D)[0, 0] for k in z]
    )
    assert np.allclose(found.siso(S), C * HELD / (S + 1), rtol=1e-12)


def test_without_samplers_it_is_exact():
    found = continuous_approximation(system([[-1, 1, 0], [0.5, 0.2, 1], [1, 0, 0]], (), delays=(TAU,)))
    w_gain = LATE / (1 - 0.2 * LATE)  # w = w_gain (0.5 x + e)
    assert np.allclose(found.siso(S), w_gain / (S + 1 - 0.5 * w_gain), rtol=1e-13)
    assert found.channels == (found.channels[0],) and found.delays == (TAU,)
