"""A verdict that stays right where Padé approximants fail: equation 3.8 with K = 10, 400 delays up to half a second."""

import control
import numpy as np
import pytest

from delaytools.analysis.characteristic_roots import unstable_count
from delaytools.analysis.delay_sweep import delay_windows
from delaytools.linear.algebra import delay, feedback
from delaytools.linear.delay_system import as_delay_system

DENOMINATOR = np.polymul([1.0, 17.86, 14050.0], [0.5, 1.0])
PLANT = control.tf([10 * 14050.0], DENOMINATOR)
DELAYS = np.linspace(0.5e-3, 0.5, 400)


def by_pade(tau: float) -> int:
    """Roots with Re s > 0 of the loop with a Padé approximant of order 10."""
    numerator, denominator = control.pade(tau, 10)
    closed = np.polyadd(np.polymul(DENOMINATOR, denominator), np.polymul([10 * 14050.0], numerator))
    return int(np.sum(np.roots(closed).real > 0))


@pytest.fixture(scope="module")
def counts() -> np.ndarray:
    return delay_windows(as_delay_system(PLANT), float(DELAYS[-1])).unstable_counts(DELAYS)


def test_counts_by_crossings_are_those_by_the_argument_principle(counts: np.ndarray) -> None:
    for tau, known in list(zip(DELAYS, counts, strict=True))[::9]:
        found = unstable_count(feedback(delay(float(tau)) * as_delay_system(PLANT)))
        assert found.certified and found.count == known, tau


def test_pade_of_order_10_is_wrong_at_179_delays(counts: np.ndarray) -> None:
    wrong = np.array([by_pade(tau) for tau in DELAYS]) != counts
    assert wrong.sum() == 179
    assert DELAYS[wrong].min() > 0.1  # right while the delay is short
