"""Laws that margins obey whatever the loop: scaling of gain and time, delay in series, symmetry."""

import control
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from delaytools.analysis.margins import Margins, margins
from delaytools.linear.algebra import delay
from delaytools.linear.delay_system import DelaySystem, as_delay_system


@st.composite
def loops(draw: st.DrawFn) -> tuple[list[complex], float, float]:
    """(poles, gain, delay) of gain Π|p| e^{-sτ}/Π(s - p): one real pole, one pair, sometimes an integrator."""
    real = -draw(st.floats(0.2, 5.0))
    wn, zeta = draw(st.floats(0.3, 8.0)), draw(st.floats(0.02, 0.9))
    pair = complex(-zeta * wn, wn * np.sqrt(1 - zeta**2))
    poles: list[complex] = [real, pair, pair.conjugate()]
    if draw(st.booleans()):
        poles.append(0.0)
    size = draw(st.one_of(st.floats(0.02, 0.9), st.floats(1.1, 1.5)))  # |L(0)| = 1 has its crossing at 0
    return poles, size, draw(st.one_of(st.just(0.0), st.floats(1e-4, 1.0)))


def built(loop: tuple[list[complex], float, float], *, gain: float = 1.0, time: float = 1.0) -> DelaySystem:
    poles, size, tau = loop
    scaled = [p / time for p in poles]
    numerator = gain * size * np.prod([abs(p) if p else 1.0 for p in poles]) / time ** len(poles)
    return delay(tau * time) * as_delay_system(control.zpk([], scaled, numerator))


def stable_margins(loop: tuple[list[complex], float, float]) -> Margins:
    found = margins(built(loop))
    assume(found.stable and found.gain_margin is not None and found.modulus_margin > 1e-3)
    return found


@settings(max_examples=25, deadline=None)
@given(loops(), st.floats(1e-3, 1e3))
def test_time_scaling(loop: tuple[list[complex], float, float], scale: float) -> None:
    before, after = stable_margins(loop), margins(built(loop, time=scale))
    assert after.gain_margin == pytest.approx(before.gain_margin, rel=1e-8)
    assert after.modulus_margin == pytest.approx(before.modulus_margin, rel=1e-9)
    if before.delay_margin is not None:
        assert after.delay_margin == pytest.approx(scale * before.delay_margin, rel=1e-8)
        assert after.phase_margin_frequency == pytest.approx(before.phase_margin_frequency / scale, rel=1e-8)


@settings(max_examples=25, deadline=None)
@given(loops(), st.floats(0.05, 0.95))
def test_gain_moves_the_gain_margin_inversely(loop: tuple[list[complex], float, float], part: float) -> None:
    before = stable_margins(loop)
    assume(before.gain_margin > 1 and all(c.gain < 1 for c in before.crossings if c.kind == "phase"))
    factor = before.gain_margin**part
    after = margins(built(loop, gain=factor))
    assert after.stable
    assert after.gain_margin == pytest.approx(before.gain_margin / factor, rel=1e-9)
    assert not margins(built(loop, gain=before.gain_margin * (1 + 1e-6))).stable


@settings(max_examples=25, deadline=None)
@given(loops(), st.floats(0.05, 0.95))
def test_series_delay_eats_the_delay_margin(loop: tuple[list[complex], float, float], part: float) -> None:
    before = stable_margins(loop)
    assume(before.delay_margin is not None)
    extra = part * before.delay_margin
    after = margins(delay(extra) * built(loop))
    assert after.stable
    assert after.delay_margin == pytest.approx(before.delay_margin - extra, rel=1e-8)
    assert not margins(delay(before.delay_margin * (1 + 1e-6)) * built(loop)).stable


@settings(max_examples=25, deadline=None)
@given(loops())
def test_modulus_and_disk_bound_the_classical_margins(loop: tuple[list[complex], float, float]) -> None:
    found = stable_margins(loop)
    alpha, modulus = found.disk_margin, found.modulus_margin
    assert 0 < modulus <= 1 + 1e-12 and 0 < alpha <= 2 + 1e-12
    if found.gain_margin > 1:
        assert found.gain_margin >= 1 / (1 - modulus) * (1 - 1e-9) if modulus < 1 else True
        assert found.gain_margin >= (2 + alpha) / (2 - alpha) * (1 - 1e-9) if alpha < 2 else True
    if found.phase_margin is not None:
        assert abs(found.phase_margin) >= 2 * np.arctan(alpha / 2) * (1 - 1e-9)
        assert abs(found.phase_margin) >= 2 * np.arcsin(modulus / 2) * (1 - 1e-9)
