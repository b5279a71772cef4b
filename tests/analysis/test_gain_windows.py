"""Intervals of gain against certified counts, published loops and the practice bench."""

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from delaytools.analysis.gain_windows import GAINS, stable_gains
from delaytools.analysis.margins import Crossing, margins
from delaytools.analysis.questions import loop_allowances
from delaytools.analysis.stability import closed_loop_of, roots_not_left
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.linear.algebra import delay
from delaytools.linear.delay_system import DelaySystem, as_delay_system

LOOPS = {
    "three integrators": as_delay_system(ct.tf([2.0, 4.0, 2.0], [1.0, 0.0, 0.0, 0.0])),
    "thesis 3.8": delay(0.02) * ct.tf([3 * 14050.0], np.polymul([1.0, 17.86, 14050.0], [0.5, 1.0])),
    "unstable plant": delay(0.05) * ct.tf([4.0, 3.0], [1.0, -1.0, 0.0]),
    "lightly damped": delay(2.6) * ct.tf([0.06, 0.24, 0.18], [1.0, 0.3, 1.0, 0.0]),
}


def windows(L: DelaySystem) -> tuple[tuple[float, float], ...]:
    return stable_gains(margins(L).crossings, lambda k: roots_not_left(closed_loop_of(L * k)) == 0).stable


def test_three_integrators_need_gain() -> None:
    """2 (s + 1)²/s³: s³ + 2k s² + 4k s + 2k is stable for 8k² > 2k (Routh)."""
    ((low, high),) = windows(LOOPS["three integrators"])
    assert low == pytest.approx(0.25, rel=1e-9) and high == GAINS[1]


def test_the_thesis_loop_ends_at_its_gain_margin() -> None:
    ((low, high),) = windows(LOOPS["thesis 3.8"])
    assert low == GAINS[0] and high == pytest.approx(7.6458805127, rel=1e-9)


@pytest.mark.parametrize("name", LOOPS)
@given(exponent=st.floats(-2.0, 2.0))
@settings(max_examples=12, deadline=None)
def test_a_gain_is_inside_where_a_count_says_so(name: str, exponent: float) -> None:
    L, k = LOOPS[name], 10.0**exponent
    found = windows(L)
    if min((abs(np.log(k / edge)) for pair in found for edge in pair), default=1.0) > 1e-6:
        assert any(low < k < high for low, high in found) == (roots_not_left(closed_loop_of(L * k)) == 0)


SAMPLED = """
frame = "1 ms"
[blocks.plant]
type = "integrator"
input = "u"
output = "y"
[blocks.law]
type = "sample_hold"
input = "-10*y"
output = "u"
period = "50 ms"
[analysis]
at = "u"
"""


def test_a_sampled_integrator() -> None:
    """z = 1 - 10 k T: stable for k < 2/(10 T) = 4."""
    found = loop_allowances(build(parse_design(SAMPLED)), "u")
    assert found.gains.looked_at == GAINS and found.jitter_sampling == "continuous approximation"
    assert found.gains.stable[0][1] == pytest.approx(4.0, rel=1e-9) and len(found.gains.stable) == 1
    assert found.exact is not None and found.approximate is not None
    assert found.exact.gain_margin == pytest.approx(4.0, rel=1e-9)
    # 10 (1 - e^(-sT))/(s²T): π at ωT/2 = π/2 beyond -90° - ωT/2, so ω = π/T: |L| = 10 (2/T)/ω² = 10 · 2T/π²
    assert found.approximate.gain_margin == pytest.approx(np.pi**2 / (20 * 0.05), rel=1e-9)


def test_an_unstable_loop_bears_no_jitter() -> None:
    found = loop_allowances(build(parse_design(SAMPLED.replace("-10*y", "-50*y"))), "u")
    assert found.jitter is None and found.gains.stable[0][1] == pytest.approx(0.8, rel=1e-9)


def test_crossings_without_end_are_looked_at_near_one_alone() -> None:
    """A loop that comes back to itself directly has them without end: those nearest to 1 count, and it is said."""
    factors = np.geomspace(0.02, 50.0, 201)
    crossings = [Crossing("phase", float(k), 1 / m, np.pi, float(m)) for k, m in enumerate(factors)]
    asked: list[float] = []
    found = stable_gains(crossings, lambda k: asked.append(k) is None and k < 1)
    assert 40 <= len(asked) <= 50
    assert found.looked_at == (pytest.approx(factors[76]), pytest.approx(factors[125]))
    assert found.stable == ((found.looked_at[0], pytest.approx(1.0)),)
