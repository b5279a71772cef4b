"""Neutral loops and small changes of delay: published values, μ against brute force, and words in answers."""

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from delaytools.analysis.characteristic_roots import rightmost_roots
from delaytools.analysis.questions import loop_margins, loop_roots
from delaytools.analysis.strong_stability import strong_stability
from delaytools.analysis.structured_value import structured_value
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.linear.algebra import delay, feedback
from delaytools.linear.channel import Delay
from delaytools.linear.delay_system import DelaySystem


def neutral(second: float) -> DelaySystem:
    """d/dt [x - 0.75 x(t-1) + 0.5 x(t-t2)] = 0.25 x - x(t-1)/3, of v = what is differentiated."""
    nothing = np.zeros((0, 0))
    return DelaySystem(
        A=[[0.25]], B1=np.zeros((1, 0)), B2=[[0.25 * 0.75 - 1 / 3, -0.25 * 0.5]], C1=np.zeros((0, 1)),
        C2=[[1.0], [1.0]], D11=nothing, D12=np.zeros((0, 2)), D21=np.zeros((2, 0)),
        D22=[[0.75, -0.5], [0.75, -0.5]], channels=(Delay(1.0), Delay(second)),
    )  # fmt: skip


def test_the_published_neutral_loop() -> None:
    """TDS-CONTROL manual, example 2.6: stable for delays of 1 and 2 s, unstable for 1 and 2.05 s."""
    found = strong_stability(neutral(2.0))
    assert found.gamma == pytest.approx(1.25, rel=1e-12)
    assert found.abscissa == pytest.approx(0.16160045805922925, rel=1e-9)
    assert not found.is_strong and "small change" in found.words and found.channels == (0, 1)
    assert rightmost_roots(neutral(2.05), up_to=100.0).roots[0].real > 0.15
    near = strong_stability(neutral(2.05)).abscissa  # the rightmost roots of a long chain lie near it
    assert rightmost_roots(neutral(2.05), up_to=100.0).roots[0].real == pytest.approx(near, abs=1e-5)


def test_retarded_loops_are_strong() -> None:
    loop = feedback(delay(0.1) * ct.tf([2.0], [1.0, 0.0]))
    found = strong_stability(loop)
    assert found.gamma == 0.0 and found.abscissa == -np.inf and found.is_strong and found.words == ""


@pytest.mark.parametrize("gain", [0.9, 0.3, 1e-3, 1e-10])
def test_of_one_circle_the_abscissa_is_exact(gain: float) -> None:
    """y = u + gain y(t - 0.2): chains of roots at Re s = ln(gain)/0.2."""
    found = strong_stability(feedback(-gain * delay(0.2)))
    assert found.gamma == pytest.approx(gain) and found.is_strong
    assert found.abscissa == pytest.approx(np.log(gain) / 0.2, rel=1e-9)


def test_a_direct_gain_of_rounding_is_none() -> None:
    assert strong_stability(feedback(1e-16 * delay(0.2))).channels == ()


@given(st.integers(2, 3), st.integers(0, 10_000), st.booleans())
@settings(max_examples=25, deadline=None)
def test_mu_against_all_angles(size: int, seed: int, real: bool) -> None:
    draw = np.random.default_rng(seed)
    matrix = draw.standard_normal((size, size)) + (0 if real else 1j) * draw.standard_normal((size, size))
    found = structured_value(matrix)
    grid = np.linspace(-np.pi, np.pi, 73)
    angles = np.stack(np.meshgrid(*[grid] * (size - 1)), -1).reshape(-1, size - 1)
    turned = matrix * np.exp(1j * np.column_stack([np.zeros(len(angles)), angles]))[:, None, :]
    best = float(np.abs(np.linalg.eigvals(turned)).max())
    assert best <= found.upper * (1 + 1e-9)
    assert best == pytest.approx(found.lower, rel=2e-2) and best <= found.lower * (1 + 1e-9)
    assert found.upper == pytest.approx(found.lower, rel=1e-4)  # equal for up to three numbers
    at_lower = np.abs(np.linalg.eigvals(matrix * np.exp(1j * found.angles)[None, :])).max()
    assert at_lower == pytest.approx(found.lower, rel=1e-9)


@given(st.integers(2, 5), st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_mu_does_not_know_units(size: int, seed: int) -> None:
    draw = np.random.default_rng(seed)
    matrix, units = draw.standard_normal((size, size)), np.exp(draw.standard_normal(size))
    one, other = structured_value(matrix), structured_value(matrix * units[:, None] / units[None, :])
    assert one.upper == pytest.approx(other.upper, rel=1e-3)
    assert max(one.lower, other.lower) <= min(one.upper, other.upper) * (1 + 1e-9)


def test_what_lies_on_no_circle_counts_for_nothing() -> None:
    matrix = np.array([[0.5, 100.0, 3.0], [0.0, 0.2, 7.0], [0.0, 0.0, -0.9]])
    found = structured_value(matrix)
    assert found.lower == found.upper == 0.9


NEUTRAL = """
title = "The published neutral loop, as blocks"
frame = "10 ms"

[signals]
x = ""
one = ""
two = ""

[blocks.sum]
type = "equations"
inputs = { a = "one", b = "two" }
states = { v = 1.0 }
rates = { v = "0.25*(v + GAIN*a - 0.5*b) - a/3" }
outputs = { x = "v + GAIN*a - 0.5*b" }

[blocks.first]
type = "delay"
input = "x"
output = "one"
delay = "1 s"

[blocks.second]
type = "delay"
input = "x"
output = "two"
delay = "2 s"

[analysis]
at = "x"
"""


@pytest.mark.parametrize(("gain", "fragile"), [(0.75, True), (0.4, False)])
def test_a_verdict_that_hangs_on_exact_delays_says_so(gain: float, fragile: bool) -> None:
    loop = build(parse_design(NEUTRAL.replace("GAIN", str(gain)), "neutral.toml"))
    for answer in (loop_margins(loop, "x"), loop_roots(loop, "x")):
        assert ("small change" in answer.small_delays) == fragile
    assert loop_margins(loop, "x").margins[0].stable
