"""No crossing is missed: against dense grids, high precision arithmetic and constructed touches."""

import control
import mpmath
import numpy as np
import pytest

from delaytools.analysis.bracketing import refined_minima, refined_roots
from delaytools.analysis.crossings import gain_crossings, phase_crossings
from delaytools.analysis.margins import curve_of, margins
from delaytools.linear.algebra import delay, feedback
from delaytools.linear.delay_system import DelaySystem, as_delay_system


def rational(zeros: list[complex], poles: list[complex], gain: float) -> DelaySystem:
    return as_delay_system(control.zpk(zeros, poles, gain))


def brute(L: DelaySystem, low: float, high: float, n: int = 2_000_000) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies of sign changes of log |L| and of arg L through π on a dense grid."""
    omega = np.geomspace(low, high, n)
    value = np.concatenate([L.siso(1j * part) for part in np.array_split(omega, 20)])
    level, turn = np.log(np.abs(value)), value.imag / np.abs(value)
    gain = omega[:-1][np.sign(level[:-1]) != np.sign(level[1:])]
    negative = (value.real[:-1] < 0) & (np.abs(turn[:-1] - turn[1:]) < 0.5)
    phase = omega[:-1][(np.sign(turn[:-1]) != np.sign(turn[1:])) & negative & (np.abs(value[:-1]) > 0.01)]
    return gain, phase


LOOPS = {
    "three resonances": rational(
        [], [-0.1, -0.01 + 1j, -0.01 - 1j, -0.02 + 3j, -0.02 - 3j, -0.05 + 9j, -0.05 - 9j], 20.0
    ),
    "resonances and notches": rational(
        [-0.01 + 2j, -0.01 - 2j, -0.03 + 5j, -0.03 - 5j],
        [-1.0, -0.001 + 1j, -0.001 - 1j, -0.004 + 4j, -0.004 - 4j, 0.0],
        0.4,
    ),
    "lightly damped with delay": delay(0.7) * rational([], [-0.003 + 3j, -0.003 - 3j, -0.5], 0.6),
    "delay in an inner loop": feedback(rational([], [-0.2, -1.0], 1.0), delay(3.0) * as_delay_system(1.5))
    * rational([], [0.0], 0.5),
    "long delay": delay(40.0) * rational([], [-1.0], 0.9),
}


@pytest.mark.parametrize("name", LOOPS)
def test_same_crossings_as_a_dense_grid(name: str) -> None:
    L = LOOPS[name]
    curve = curve_of(L)
    gain, phase = brute(L, curve.omega[0], min(curve.omega[-1], 300.0))
    found = gain_crossings(curve).omega
    assert len(found) == len(gain) and found == pytest.approx(gain, rel=2e-5)
    crossings = phase_crossings(curve, np.zeros(1))
    listed = crossings.omega[(crossings.gain > 0.01) & (crossings.omega < 300.0)]
    assert len(listed) == len(phase) and listed == pytest.approx(phase, rel=2e-5)


def test_light_damping() -> None:
    # ζ = 1e-3 and 1e-5: the peak is 1e3 and 1e5 high, and as narrow; both gain crossings in closed form
    for zeta in (1e-3, 1e-5):
        k = 0.01
        found = gain_crossings(curve_of(as_delay_system(control.tf([k], [1.0, 2 * zeta, 1.0])))).omega
        expected = np.sqrt(np.roots([1.0, 4 * zeta**2 - 2.0, 1.0 - k**2]).real)
        assert found == pytest.approx(np.sort(expected), rel=1e-12)


def test_undamped_mode_and_integrators() -> None:
    # poles at ±2j: |L| = 1 at sqrt(3) and sqrt(5), on both sides of the pole
    undamped = as_delay_system(control.tf([1.0], [1.0, 0.0, 4.0]))
    found = gain_crossings(curve_of(undamped)).omega
    assert found == pytest.approx(np.sqrt([3.0, 5.0]), rel=1e-13)


@pytest.mark.parametrize("above", [1e-3, 1e-6, 1e-8])
def test_nearly_touching_gain_crossings(above: float) -> None:
    # the top of k/(s^2 + 0.2 s + 1) lifted just over 1: two crossings closer together than any grid
    zeta = 0.1
    k = 2 * zeta * np.sqrt(1 - zeta**2) * (1 + above)
    found = gain_crossings(curve_of(as_delay_system(control.tf([k], [1.0, 2 * zeta, 1.0])))).omega
    with mpmath.workdps(40):
        b = 4 * mpmath.mpf(zeta) ** 2 - 2
        root = mpmath.sqrt(b * b - 4 * (1 - mpmath.mpf(k) ** 2))
        expected = [float(mpmath.sqrt((-b - root) / 2)), float(mpmath.sqrt((-b + root) / 2))]
    assert len(found) == 2
    assert found == pytest.approx(expected, rel=1e-14 / np.sqrt(above))


@pytest.mark.parametrize("beyond", [1e-2, 1e-5, 1e-8])
def test_nearly_touching_phase_crossings(beyond: float) -> None:
    # -(s + a)^2/(s (s + 1)^3): Im L = 0 where (2a - 3) x^2 + (3a^2 - 6a + 1) x - a^2 = 0, x = w^2; below the a of
    # a double root the phase rises just past π and comes back: two crossings side by side
    touch = float(mpmath.findroot(lambda a: 3 * a**2 - 6 * a + 1 - 2 * a * mpmath.sqrt(3 - 2 * a), 0.11))
    a = touch * (1 - beyond)
    with mpmath.workdps(40):
        exact = mpmath.mpf(a)
        b, c, d = 2 * exact - 3, 3 * exact**2 - 6 * exact + 1, -(exact**2)
        root = mpmath.sqrt(c * c - 4 * b * d)
        expected = sorted(float(mpmath.sqrt((-c + sign * root) / (2 * b))) for sign in (-1, 1))
    L = as_delay_system(control.tf(-np.poly([-a, -a]), np.poly([-1.0, -1.0, -1.0, 0.0])))
    found = phase_crossings(curve_of(L), np.zeros(1)).omega
    assert found == pytest.approx(expected, rel=1e-14 / np.sqrt(beyond))


def test_crossings_to_the_last_digit() -> None:
    # 40-digit roots of |L| = 1 and arg L = -π for 3 e^{-0.35 s}/((s+1)(0.2 s+1))
    L = delay(0.35) * as_delay_system(control.tf([3.0], np.polymul([1.0, 1.0], [0.2, 1.0])))
    with mpmath.workdps(40):
        tau = mpmath.mpf(0.35)
        gain = mpmath.findroot(lambda w: (1 + w**2) * (1 + (mpmath.mpf(0.2) * w) ** 2) - 9, 2)
        phase = mpmath.findroot(
            lambda w: mpmath.atan(w) + mpmath.atan(mpmath.mpf(0.2) * w) + tau * w - mpmath.pi, 4
        )
        size = 3 / mpmath.sqrt((1 + phase**2) * (1 + (mpmath.mpf(0.2) * phase) ** 2))
        angle = mpmath.pi - mpmath.atan(gain) - mpmath.atan(mpmath.mpf(0.2) * gain) - tau * gain
        expected = [float(v) for v in (gain, phase, 1 / size, angle, angle / gain)]
    found = margins(L)
    got = [found.phase_margin_frequency, found.gain_margin_frequency, found.gain_margin]
    got += [found.phase_margin, found.delay_margin]
    assert got == pytest.approx(expected, rel=1e-13)


def test_bracketing_alone() -> None:
    shift = np.linspace(0.1, 5.0, 200)
    roots = refined_roots(lambda x, which: x**3 - shift[which], np.zeros(200), np.full(200, 3.0))
    assert roots == pytest.approx(np.cbrt(shift), rel=1e-14)
    x, value = refined_minima(
        lambda x, which: np.cosh(x - shift[which]), np.full(200, -1.0), shift + 0.3, np.full(200, 8.0)
    )
    assert value == pytest.approx(np.ones(200), rel=1e-15) and x == pytest.approx(shift, abs=1e-6)
