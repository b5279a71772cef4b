"""Margins against known answers: figures published, or computed with 30 digits by other methods.

Each entry names its source; figures given with n digits are held to n digits.
"""

import control
import numpy as np
import pytest

from delaytools.analysis.closed_loop import closed_loop, complementary_sensitivity, sensitivity
from delaytools.analysis.delay_sweep import delay_windows, sweep_margins
from delaytools.analysis.margins import Margins, margins
from delaytools.linear.algebra import delay
from delaytools.linear.delay_system import DelaySystem, as_delay_system

POSITION_LOOP = np.polymul([1.0, 17.86, 14050.0], [0.5, 1.0])  # (s^2 + 17.86 s + 14050)(0.5 s + 1)


def loop(numerator: list[float], denominator: np.ndarray | list[float], tau: float = 0.0) -> DelaySystem:
    return delay(tau) * as_delay_system(control.tf(numerator, denominator))


def test_allmargin_example_of_matlab() -> None:
    # MATLAB documentation of allmargin: 3.6000 at 3.1623, 29.1104 deg at 1.7844, 0.2847 s
    found = margins(loop([25.0], [1.0, 10.0, 10.0, 10.0]))
    assert found.stable and found.why == {}
    assert found.gain_margin == pytest.approx(3.6, rel=1e-12)
    assert found.gain_margin_frequency == pytest.approx(np.sqrt(10.0), rel=1e-12)
    assert np.degrees(found.phase_margin) == pytest.approx(29.1104, abs=5e-5)
    assert found.phase_margin_frequency == pytest.approx(1.7844, abs=5e-5)
    assert found.delay_margin == pytest.approx(0.284724078507, abs=5e-13)


def test_pi_on_a_lightly_damped_plant_with_dead_time() -> None:
    # the loop of MATLAB's "Analyzing Control Systems with Delays", 0.06 (s+1)(s+3)/(s (s^2+0.3s+1)), 2.6 s
    found = margins(loop([0.06, 0.24, 0.18], [1.0, 0.3, 1.0, 0.0], 2.6))
    assert found.gain_margin == pytest.approx(1.5657579151, rel=1e-10)
    assert found.gain_margin_frequency == pytest.approx(0.7594121193, rel=1e-10)
    assert np.degrees(found.phase_margin) == pytest.approx(72.6797273653, rel=1e-10)
    assert found.phase_margin_frequency == pytest.approx(0.190147046835, rel=1e-10)
    assert found.delay_margin == pytest.approx(6.671155629751, rel=1e-10)


def test_three_gain_crossovers() -> None:
    # double-mass drive of ControlSystems.jl test_analysis.jl (there 0.0374333613 to 1e-6; exact value computed)
    found = margins(loop([100.0, 200.0, 10000.0], [0.002, 1.008, 4.406, 203.4, 200.0, 0.0]))
    gains = [c for c in found.crossings if c.kind == "gain"]
    expected = [
        (6.18054701668, 13.25593021, 0.03743351956247),
        (13.314200174746, 103.39977269, 0.1355444905104),
        (15.389773286216, 40.68722577, 0.04614272347623),
    ]
    for crossing, (frequency, degrees, seconds) in zip(gains, expected, strict=True):
        assert crossing.frequency == pytest.approx(frequency, rel=1e-11)
        assert np.degrees(crossing.margin) == pytest.approx(degrees, rel=1e-9)
        assert crossing.margin / crossing.frequency == pytest.approx(seconds, rel=1e-11)
    assert found.delay_margin == pytest.approx(0.03743351956247, rel=1e-12)


# the thesis's equation 3.8 in a loop, K = 3: K 14050 e^(-s tau)/((s^2+17.86s+14050)(0.5s+1)); computed
@pytest.mark.parametrize(
    ("tau", "gain", "frequency", "degrees"),
    [
        (0.0, 2.985081841, None, 109.0113847602),
        (0.020, 7.6458805127, 72.5880533333, 102.5125678653),
        (0.050, 3.2003033187, 120.88703693, 92.764342523),
    ],
)
def test_gain_margin_is_not_monotone_in_delay(
    tau: float, gain: float, frequency: float | None, degrees: float
) -> None:
    plant = loop([3.0 * 14050.0], POSITION_LOOP)
    for found in (margins(delay(tau) * plant), sweep_margins(plant, [tau]).margins[0]):
        assert found.gain_margin == pytest.approx(gain, rel=2e-10)
        if frequency is not None:
            assert found.gain_margin_frequency == pytest.approx(frequency, rel=1e-9)
        assert np.degrees(found.phase_margin) == pytest.approx(degrees, rel=1e-10)
        assert found.delay_margin == pytest.approx(0.335480708330189 - tau, rel=1e-12)


def test_stability_window_and_its_repetition() -> None:
    plant = loop([3.0 * 14050.0], POSITION_LOOP)
    assert margins(plant).delay_margin == pytest.approx(0.335480708330189, rel=1e-13)
    windows = delay_windows(plant, 4.0)
    assert windows.delays[0] == pytest.approx(0.335480708330189, rel=1e-13)
    assert np.diff(windows.delays) == pytest.approx(1.107893962309725, rel=1e-13)
    swept = sweep_margins(plant, np.linspace(0.0, 4.0, 41))
    assert swept.stable_delays == ((0.0, pytest.approx(0.335480708330189, rel=1e-13)),)
    assert swept.stable == tuple(np.linspace(0.0, 4.0, 41) < 0.3354)


def test_ten_times_gain_is_unstable() -> None:
    # the same loop with K = 10: past its gain margin 3 * 2.985081841 = 8.955 at no delay
    found = margins(loop([10.0 * 14050.0], POSITION_LOOP))
    assert not found.stable
    assert found.gain_margin is None and found.delay_margin is None and found.modulus_margin is None
    assert set(found.why.values()) == {"closed loop unstable"}
    assert any(c.kind == "gain" for c in found.crossings)


def test_delayed_duffing_crossings_both_ways() -> None:
    # s^2 + 0.05 s + 1.1 - 0.6 e^(-s tau), DDE-BIFTOOL minimal demo; figures computed
    L = loop([-0.6], [1.0, 0.05, 1.1])
    windows = delay_windows(L, 18.0)
    stabilising = [8.793115235124750, 17.669612205482888]
    destabilising = [2.495505415097677, 7.319520583168996, 12.14353575124031, 16.967550919311633]
    assert windows.delays[windows.change < 0] == pytest.approx(stabilising, rel=1e-12)
    assert windows.delays[windows.change > 0] == pytest.approx(destabilising, rel=1e-12)
    assert windows.unstable_counts(np.array([1.0, 5.0, 8.0, 10.0, 14.0, 17.2, 17.8])).tolist() == [
        0, 2, 4, 2, 4, 6, 4,
    ]  # fmt: skip
    assert sweep_margins(L, np.linspace(0, 18, 19)).stable_delays == (
        (0.0, pytest.approx(2.495505415097677, rel=1e-13)),
    )


# rate loop K A(s) S(s) e^(-s tau)/s, A: 180 rad/s, 0.6; S: 377 rad/s, 0.6; computed, digits as given
@pytest.mark.parametrize(
    ("tau", "gain", "hertz"),
    [(0.0, 130.8, 21.42), (0.012, 67.2, 11.15), (0.015, 59.99, 9.88), (0.018, 54.1, 8.86)],
)
def test_ultimate_gain_of_the_rate_loop(tau: float, gain: float, hertz: float) -> None:
    found = margins(delay(tau) * rate_loop())
    assert found.gain_margin == pytest.approx(gain, abs=0.05 if gain != 59.99 else 0.005)
    assert found.gain_margin_frequency / (2 * np.pi) == pytest.approx(hertz, abs=0.005)


def test_inverse_compensator_lowers_the_ultimate_gain() -> None:
    compensator = 16.0 - 15.0 * delay(0.001)
    assert margins(compensator * delay(0.015) * rate_loop()).gain_margin == pytest.approx(50.7, abs=0.05)


def rate_loop() -> DelaySystem:
    actuator = control.tf([180.0**2], [1.0, 2 * 0.6 * 180.0, 180.0**2])
    sensor = control.tf([377.0**2], [1.0, 2 * 0.6 * 377.0, 377.0**2])
    return as_delay_system(actuator * sensor * control.tf([1.0], [1.0, 0.0]))


# m x'' + c x' + k x(t - tau) = 0, wn = 2 pi: tau = atan(c/(m w))/w; figures to 7 digits from the formula
@pytest.mark.parametrize(
    ("zeta", "tau"), [(0.01, 3.1833e-3), (0.02, 6.3679e-3), (0.05, 15.9420e-3), (0.10, 32.0428e-3)]
)
def test_critical_delay_of_delayed_stiffness(zeta: float, tau: float) -> None:
    wn = 2 * np.pi
    L = loop([wn**2], [1.0, 2 * zeta * wn, 0.0])
    c, k = 2 * zeta * wn, wn**2
    w = np.sqrt((-(c**2) + np.sqrt(c**4 + 4 * k**2)) / 2)
    assert margins(L).delay_margin == pytest.approx(tau, abs=5e-8)
    assert margins(L).delay_margin == pytest.approx(np.arctan(c / w) / w, rel=1e-13)


def test_critical_delay_with_half_the_stiffness_delayed() -> None:
    wn, zeta = 2 * np.pi, 0.05
    L = loop([0.5 * wn**2], [1.0, 2 * zeta * wn, 0.5 * wn**2])
    assert margins(L).delay_margin == pytest.approx(32.045e-3, abs=5e-7)


def test_margins_that_never_come() -> None:
    found = margins(loop([0.5], [1.0, 1.0]))
    assert found.gain_margin is None and found.why["gain_margin"] == "never"
    assert found.delay_margin is None and found.why["delay_margin"] == "never"
    assert found.modulus_margin == pytest.approx(1.0) and found.disk_margin == pytest.approx(2.0)


def test_gain_that_must_not_fall() -> None:
    # 2/(s - 1): stable for K > 1/2; L(0) = -2 is the crossing at zero frequency
    found = margins(loop([2.0], [1.0, -1.0]))
    assert found.stable and found.gain_margin == pytest.approx(0.5, rel=1e-14)
    assert found.gain_margin_frequency == 0.0
    # |L| = 1 at w = sqrt(3); arg L = -pi + atan(sqrt 3): 60 deg, and (pi/3)/sqrt(3) s
    assert found.phase_margin == pytest.approx(np.pi / 3, rel=1e-13)
    assert found.delay_margin == pytest.approx(np.pi / 3 / np.sqrt(3.0), rel=1e-13)


def test_conditionally_stable_loop_takes_the_nearer_side() -> None:
    # K (s+1)^2/s^3, unstable for K < 1/2: at K = 0.6 the gain margin is a reduction, 0.5/0.6
    found = margins(loop(list(0.6 * np.poly([-1.0, -1.0])), [1.0, 0.0, 0.0, 0.0]))
    assert found.stable and found.gain_margin == pytest.approx(0.5 / 0.6, rel=1e-12)


def test_direct_gain() -> None:
    # 2 (s+1)/(s+3): stable, yet any delay lets in infinitely many roots; -0.5(s+1)/(s+3): K = 2 closes at infinity
    assert margins(loop([2.0, 2.0], [1.0, 3.0])).delay_margin == 0.0
    found = margins(loop([-0.5, -0.5], [1.0, 3.0]))
    assert found.gain_margin == pytest.approx(2.0) and found.gain_margin_frequency == np.inf


def test_pure_delay_gain() -> None:
    found = margins(0.5 * delay(1.0))
    assert found.stable and found.gain_margin == pytest.approx(2.0)
    assert found.modulus_margin == pytest.approx(0.5)
    assert found.delay_margin is None and found.why["delay_margin"] == "never"


def test_closed_loop_peaks() -> None:
    L = loop([25.0], [1.0, 10.0, 10.0, 10.0])
    found = closed_loop(L)
    omega = np.linspace(1.0, 4.0, 300_001)
    S, T = (np.abs(system.siso(1j * omega)) for system in (sensitivity(L), complementary_sensitivity(L)))
    assert found.sensitivity_peak == pytest.approx(S.max(), rel=1e-9)
    assert found.sensitivity_peak_frequency == pytest.approx(omega[S.argmax()], abs=1e-5)
    assert found.complementary_peak == pytest.approx(T.max(), rel=1e-9)
    assert found.complementary_peak_frequency == pytest.approx(omega[T.argmax()], abs=1e-5)
    assert margins(L).modulus_margin == pytest.approx(1.0 / found.sensitivity_peak, rel=1e-12)
    edge = np.abs(complementary_sensitivity(L).siso(1j * found.bandwidth))
    assert edge == pytest.approx(10 ** (-3 / 20) * 25 / 35, rel=1e-12)


def test_answers_are_records() -> None:
    found = margins(loop([25.0], [1.0, 10.0, 10.0, 10.0]))
    assert isinstance(found, Margins) and found.sampling == "exact" and found.linearised_without == ()
    with pytest.raises(AttributeError):
        found.stable = False  # type: ignore[misc]
