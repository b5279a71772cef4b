"""Characteristic roots against published and independently computed values (30-digit arithmetic)."""

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from delaytools.analysis.characteristic_roots import rightmost_roots, roots_over_delays, unstable_count
from delaytools.analysis.root_bounds import enclosing_box
from delaytools.analysis.root_contour import counted_in
from delaytools.analysis.root_newton import newton
from delaytools.linear.algebra import delay, feedback, from_delay_differential, hold
from delaytools.linear.channel import Delay
from delaytools.linear.delay_system import DelaySystem, as_delay_system
from delaytools.signals.trouble import AnalysisError

VERHEYDEN = [
    [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -10, -4], [0, 0, 4, -10]],
    [[3, 3, 3, 3], [0, -1.5, 0, 0], [0, 0, 3, -5], [0, 5, 5, 5]],
]
# name and source, A_k, delays, some of the rightmost roots, (line, number of roots right of it)
ROOTS = [
    (
        "x' = -x(t-1): Lambert W, QPmR's example", [[[0.0]], [[-1.0]]], [0.0, 1.0],
        [
            -0.31813150520476413 + 1.3372357014306895j, -2.062277729598284 + 7.588631178472513j,
            -2.6531919740386973 + 13.949208334533214j,
        ],
        (-4.0, 18),
    ),
    (
        "Verheyden 2008, TDS-CONTROL manual example 2.1", VERHEYDEN, [0.0, 1.0],
        [
            0.6176424667760743, 0.2727748279224704 + 0.8803809706308097j,
            -0.4527168158153295 + 6.881164585041482j, -0.4530309809916682 + 1.1796978476604034j,
            -0.4799236604931514 + 4.81987555593179j, -0.6970019416730567 + 12.703570177605718j,
        ],
        (-2.5, 67),
    ),
    (
        "TDSControl C++ example, delay 3", [[[1, 3], [-7, 1]], [[-1, 2], [8, -1]]], [0.0, 3.0],
        [
            0.9135429350393786 + 4.636682896330688j, 0.3929918533407537 + 4.365550824627759j,
            0.09339303245011597 + 2.102530208464446j, 0.044445696879976,
        ],
        (-0.5, 35),
    ),
    (
        "tdscontrol example, delay 1", [[[1, 2], [-3, 4]], [[-2, 3], [5, -6]]], [0.0, 1.0],
        [
            2.729349391580808 + 2.1252757187287754j, 0.5026245261825204,
            0.09510970209213473 + 7.433235259123208j, -0.5215634465644929 + 13.875392916359441j,
        ],
        (-1.0, 9),
    ),
]  # fmt: skip
SMALL = ROOTS[0], ROOTS[3]

AXIS = ct.tf([180.0**2], [1, 2 * 0.6 * 180, 180.0**2]) * ct.tf([377.0**2], [1, 2 * 0.6 * 377, 377.0**2])
RATE = AXIS * ct.tf([1], [1, 0])


def neutral(t2: float) -> DelaySystem:
    """d/dt[x - 0.75 x(t-1) + 0.5 x(t-t2)] = 0.25 x - x(t-1)/3, with the state q = the bracket."""
    return DelaySystem(
        A=[[0.25]], B1=np.zeros((1, 0)), B2=[[0.25 * 0.75 - 1 / 3, -0.125]], C1=[[1.0]], C2=[[1.0], [1.0]],
        D11=np.zeros((1, 0)), D12=[[0.75, -0.5]], D21=np.zeros((2, 0)), D22=[[0.75, -0.5], [0.75, -0.5]],
        channels=(Delay(1.0), Delay(t2)),
    )  # fmt: skip


def nearest_error(roots, wanted):
    return np.abs(roots - wanted).min() / abs(wanted)


@pytest.mark.parametrize("case", ROOTS, ids=lambda case: case[0])
def test_all_roots_right_of_a_line(case):
    _, matrices, delays, wanted, (line, number) = case
    answer = rightmost_roots(from_delay_differential(matrices, delays), right_of=line)
    assert len(answer.roots) == answer.counted == number
    assert answer.certified and answer.why == "" and answer.up_to == np.inf and answer.right_of == line
    assert max(nearest_error(answer.roots, root) for root in wanted) < 1e-12
    assert np.all(np.diff(answer.roots.real) <= 0) and np.all(answer.roots.real > line)
    assert np.all(answer.residuals < 1e-10)


@pytest.mark.parametrize("case", ROOTS, ids=lambda case: case[0])
def test_default_line_holds_the_rightmost_ten(case):
    _, matrices, delays, wanted, _ = case
    system = from_delay_differential(matrices, delays)
    answer = rightmost_roots(system)
    assert answer.certified and len(answer.roots) >= 10
    assert abs(answer.roots[0].real - max(np.real(wanted))) < 1e-12
    all_of_them = rightmost_roots(system, right_of=answer.right_of - 0.1)
    assert np.allclose(all_of_them.roots[: len(answer.roots)], answer.roots, rtol=1e-11)


@pytest.mark.parametrize(
    "t2, wanted", [(2.0, -0.17011804616 + 0.823826861988j), (2.05, 0.159484474535 + 62.832247836009j)]
)
@pytest.mark.parametrize("line", [None, -0.3, -0.18])
def test_neutral(t2, wanted, line):
    """TDS-CONTROL manual example 2.6: a small change of a delay flips the verdict."""
    answer = rightmost_roots(neutral(t2), right_of=line)
    assert answer.certified and abs(answer.roots[0] - wanted) < 2e-12 * abs(wanted) + 5e-13
    assert np.isfinite(answer.up_to) and "chains" in answer.why
    assert (unstable_count(neutral(t2)).count == 0) == (t2 == 2.0)


def test_neutral_line_right_of_all_chains_is_complete():
    answer = rightmost_roots(neutral(2.05), right_of=0.5)
    assert answer.certified and answer.up_to == np.inf and len(answer.roots) == 0


@pytest.mark.parametrize(
    "omega, tau",
    [(0.7078451474902131, tau) for tau in (8.793115235124750, 17.669612205482888)]
    + [
        (1.3024804210330988, tau)
        for tau in (2.495505415097677, 7.319520583168996, 12.14353575124031, 16.967550919311633)
    ],
)
def test_hopf_points_of_the_delayed_duffing(omega, tau):
    """s^2 + 0.05 s + 1.1 - 0.6 e^(-s tau), DDE-BIFTOOL minimal demo."""
    system = feedback(ct.tf([1], [1, 0.05, 1.1]), 0.6 * delay(tau), 1)
    answer = rightmost_roots(system)
    assert answer.certified and np.abs(answer.roots - 1j * omega).min() < 1e-12
    assert unstable_count(system).on_axis == 2
    one_side = unstable_count(system.with_spans([tau * 0.999])).count
    other_side = unstable_count(system.with_spans([tau * 1.001])).count
    assert other_side - one_side == (2 if omega > 1 else -2)  # one family destabilises, the other stabilises


@pytest.mark.parametrize(
    "tau, root",
    [
        (0.005, -6.315659387373215 + 116.3771407213075j),
        (0.020, -9.262240075317468),
        (0.050, -5.244171728837558 + 119.3518884832368j),
    ],
)
def test_stability_window_loop(tau, root):
    """L = 3 14050 e^(-s tau)/((s^2 + 17.86 s + 14050)(0.5 s + 1)), equation 3.8 of the thesis."""
    loop = 3 * ct.tf([14050], [1, 17.86, 14050]) * ct.tf([1], [0.5, 1]) * delay(tau)
    answer = rightmost_roots(feedback(loop))
    assert answer.certified and abs(answer.roots[0] - root) < 1e-12 * abs(root)


@pytest.mark.parametrize(
    "zeta, published", [(0.01, 3.1833e-3), (0.02, 6.3679e-3), (0.05, 15.9420e-3), (0.10, 32.0428e-3)]
)
def test_critical_delay_of_the_restoring_force(zeta, published):
    """m x'' + c x' + k x(t - tau): w^2 = (-c^2 + sqrt(c^4 + 4 k^2))/2, tau = atan(c/w)/w, m = 1, wn = 2 pi."""
    c, k = 4 * np.pi * zeta, 4 * np.pi**2
    w = np.sqrt((-(c**2) + np.sqrt(c**4 + 4 * k**2)) / 2)
    tau = np.arctan(c / w) / w
    assert abs(tau - published) < 6e-8
    system = feedback(ct.tf([k], [1, c, 0]) * delay(tau))
    answer = rightmost_roots(system)
    assert answer.certified and abs(answer.roots[0] - 1j * w) < 1e-12 * w
    verdicts = [unstable_count(system.with_spans([tau * factor])).count for factor in (0.9999, 1.0001)]
    assert verdicts == [0, 2]


def test_critical_delay_of_half_the_stiffness():
    c, k = 4 * np.pi * 0.05, 4 * np.pi**2
    system = feedback(ct.tf([k / 2], [1, c, k / 2]) * delay(32.045e-3))
    counts = [unstable_count(system.with_spans([tau])).count for tau in (32.040e-3, 32.050e-3)]
    assert counts == [0, 2]


def smith(gain, true_tau):
    """Predictor set for 15 ms: u = K (r - y - model (1 - e^(-s 15 ms)) u)."""
    inner = feedback(as_delay_system(gain), as_delay_system(RATE) * (1 - delay(0.015)))
    return feedback(RATE * delay(true_tau) * inner)


ULTIMATE = {
    "no delay": (lambda gain: feedback(gain * RATE * delay(0.0)), 130.8, 0.05),
    "12 ms": (lambda gain: feedback(gain * RATE * delay(0.012)), 67.2, 0.05),
    "15 ms": (lambda gain: feedback(gain * RATE * delay(0.015)), 59.99, 0.005),
    "18 ms": (lambda gain: feedback(gain * RATE * delay(0.018)), 54.1, 0.05),
    "inverse compensator": (
        lambda gain: feedback(gain * (16 - 15 * delay(0.001)) * RATE * delay(0.015)), 50.7, 0.05
    ),
    "encoder referenced, 15 ms": (
        lambda gain: feedback((delay(0.015) + (1 - delay(0.015))) * gain * RATE), 130.8, 0.05
    ),
    "Smith, true 12 ms": (lambda gain: smith(gain, 0.012), 91.1, 0.05),
    "Smith, true 13.5 ms": (lambda gain: smith(gain, 0.0135), 106.5, 0.05),
    "Smith, true 15 ms": (lambda gain: smith(gain, 0.015), 130.8, 0.05),
    "Smith, true 16.5 ms": (lambda gain: smith(gain, 0.0165), 173.0, 0.05),
    "Smith, true 18 ms": (lambda gain: smith(gain, 0.018), 194.6, 0.05),
}  # fmt: skip


@pytest.mark.parametrize("name", ULTIMATE)
def test_ultimate_gain_of_the_rate_loop(name):
    """K A(s) S(s) e^(-s tau)/s, A: 180 rad/s, 0.6; S: 377 rad/s, 0.6."""
    loop, gain, half_digit = ULTIMATE[name]
    counts = [unstable_count(loop(gain + side)) for side in (-half_digit, half_digit)]
    assert [answer.count for answer in counts] == [0, 2] and all(answer.certified for answer in counts)


def test_root_on_the_line_moves_it_and_says_so():
    system = feedback(ct.tf([1], [1, 0.05, 1.1]), 0.6 * delay(2.495505415097677), 1)
    answer = rightmost_roots(system, right_of=0.0)
    assert answer.certified and answer.right_of < 0 and "moved" in answer.why
    assert len(answer.roots) == 2


def test_double_root_is_repeated():
    """s + e^{-1} e^{-s} has a double root at -1."""
    answer = rightmost_roots(feedback(delay(1.0) * ct.tf([np.exp(-1)], [1, 0])), right_of=-1.5)
    assert answer.certified and answer.counted == 2
    assert np.allclose(answer.roots, -1.0, atol=1e-7)


@pytest.mark.parametrize("denominator", [[1, 0, 0], [1, 3, 3, 1], [1, 2, 5], [1, -1]])
def test_without_delay_roots_are_eigenvalues(denominator):
    answer = rightmost_roots(as_delay_system(ct.tf([1], denominator)))
    assert answer.certified and answer.up_to == np.inf
    wanted = np.sort_complex(np.roots(denominator))
    assert np.allclose(np.sort_complex(answer.roots), wanted, atol=2e-5)


def test_hold_in_a_loop_against_newton_by_hand():
    """1 + K (1 - e^{-sT})/(s^2 T) = 0, from the equation itself."""
    K, T = 3.0, 0.4
    answer = rightmost_roots(feedback(K * hold(T) * ct.tf([1], [1, 0])), right_of=-15.0)
    s = answer.roots
    assert answer.certified and len(s) >= 6
    assert np.max(np.abs(s**2 * T + K * (1 - np.exp(-s * T))) / np.abs(s**2 * T)) < 1e-11


def test_count_sees_what_a_search_misses():
    """The count does not depend on roots found: it is the same for any line between two roots."""
    system = from_delay_differential([[[0.0]], [[-1.0]]], [0.0, 1.0])
    spans = np.array([system.delays])
    numbers = [
        int(counted_in(system, spans, enclosing_box(system, spans, c)).numbers[0]) for c in (-0.4, -2.5, -4)
    ]
    assert numbers == [2, 4, 18]


def test_missed_roots_are_reported(monkeypatch):
    """With a search that loses roots the record says so."""
    from delaytools.analysis import characteristic_roots as module

    def lossy(system, guesses, spans):
        roots, steps = newton(system, guesses, spans)
        return roots, np.where(np.abs(roots.imag) > 10, np.inf, steps)

    monkeypatch.setattr(module, "newton", lossy)
    answer = rightmost_roots(from_delay_differential([[[0.0]], [[-1.0]]], [0.0, 1.0]), right_of=-4.0)
    assert not answer.certified and answer.counted == 18
    assert "18 roots were counted" in answer.why


def test_many_delays_equal_one_by_one():
    system = feedback(50 * RATE * delay(0.015))
    delays = np.concatenate([[0.0], np.linspace(0.001, 0.03, 9)])
    together = roots_over_delays(system, None, delays, right_of=-150.0)
    for tau, answer in zip(delays, together, strict=True):
        alone = rightmost_roots(feedback(50 * RATE * delay(tau)), right_of=-150.0)
        assert answer.certified and len(answer.roots) == len(alone.roots)
        assert np.allclose(answer.roots, alone.roots, rtol=1e-10)
    by_count = roots_over_delays(system, 0, delays[:3], count=4)
    assert all(answer.certified and len(answer.roots) >= 4 for answer in by_count)


@pytest.mark.parametrize("channels, delays", [([3], [0.1]), (0, [-1.0]), (0, [np.nan])])
def test_sweep_errors(channels, delays):
    with pytest.raises(AnalysisError):
        roots_over_delays(delay(1.0), channels, delays)


def test_line_too_far_left():
    with pytest.raises(AnalysisError, match="too far left"):
        rightmost_roots(from_delay_differential([[[0.0]], [[-1.0]]], [0.0, 1.0]), right_of=-1e4)


def test_no_count_asked():
    with pytest.raises(AnalysisError):
        rightmost_roots(delay(1.0), count=0)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.1, 10.0), st.sampled_from([0, 1]))
def test_time_scaling(factor, which):
    """x'(t) = sum A_k x(t - tau_k) in a time `factor` times faster has roots `factor` times larger."""
    _, matrices, delays, _, (line, number) = SMALL[which]
    scaled = [factor * np.array(matrix) for matrix in matrices]
    answer = rightmost_roots(
        from_delay_differential(scaled, [tau / factor for tau in delays]), right_of=factor * line
    )
    plain = rightmost_roots(from_delay_differential(matrices, delays), right_of=line)
    assert answer.certified and len(answer.roots) == number
    assert np.allclose(answer.roots / factor, plain.roots, rtol=1e-9, atol=1e-10)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.05, 3.0))
def test_random_systems_are_certified_and_symmetric(seed, tau):
    generator = np.random.default_rng(seed)
    matrices = generator.normal(size=(2, 3, 3))
    answer = rightmost_roots(from_delay_differential(matrices, [0.0, tau]))
    assert answer.certified
    assert np.allclose(np.sort_complex(answer.roots), np.sort_complex(answer.roots.conj()), rtol=1e-9)
    for s in answer.roots:
        matrix = s * np.eye(3) - matrices[0] - np.exp(-s * tau) * matrices[1]
        assert np.linalg.svd(matrix, compute_uv=False)[-1] < 1e-10 * np.linalg.norm(matrix)
