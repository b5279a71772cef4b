"""Describing functions: formulas against numbers, and what every piece owes."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from delaytools.analysis.describing_functions import (
    Sines,
    closed_form,
    first_harmonics,
    gain_table,
    harmonics,
)
from delaytools.blocks.backlash import Backlash
from delaytools.blocks.block import Block, Follower
from delaytools.blocks.dead_band import DeadBand
from delaytools.blocks.quantizer import Quantizer
from delaytools.blocks.rate_limiter import RateLimiter
from delaytools.blocks.relay import Relay
from delaytools.blocks.saturation import Saturation
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.loop.loop import Element, Loop
from delaytools.loop.nonlinear_parts import NonlinearPart, parted
from delaytools.signals.expression import signal_expression
from delaytools.signals.stimulus import Sine
from delaytools.simulation.simulate import simulate

KNOWN: list[Block] = [
    DeadBand(half_width=0.3),
    Saturation(limit=0.7),
    Quantizer(step=0.2),
    Backlash(half_width=0.3),
    Relay(level=2.0, half_width=0.4),
    Relay(level=2.0),
    RateLimiter(limit=5.0),
]


def piece(block: Block) -> NonlinearPart:
    element = Element("piece", block, {"input": signal_expression("u")}, {"output": "y"})
    (found,) = parted(Loop((element,))).parts
    return found


def sines(amplitude: complex, omega: float = 10.0, mean: float = 0.0) -> Sines:
    return Sines(np.array([[mean]]), np.array([[amplitude]]), np.array([omega]))


@pytest.mark.parametrize("block", KNOWN, ids=lambda block: repr(block))
@given(size=st.floats(0.05, 50.0), angle=st.floats(-3.1, 3.1), omega=st.floats(0.5, 60.0))
@settings(max_examples=15, deadline=None)
def test_a_formula_is_what_numbers_give(block: Block, size: float, angle: float, omega: float) -> None:
    part = piece(block)
    assert closed_form(part) is not None
    given_ = sines(size * np.exp(1j * angle), omega)
    formula = first_harmonics(part, given_)[1][0, 0] / given_.amplitude[0, 0]
    numbers = first_harmonics(part, given_, 4096, closed=False)[1][0, 0] / given_.amplitude[0, 0]
    jumps = isinstance(block, Quantizer | Relay)
    largest = 4 * 2.0 / (np.pi * size) if isinstance(block, Relay) else 1.0
    followed = 2e-2 if isinstance(block, Follower) else 2e-5
    assert abs(formula - numbers) <= (2e-2 if jumps else followed) * max(largest, 1e-9)


@pytest.mark.parametrize("ratio", [0.2, 0.5, 0.537, 0.538, 0.7, 0.9, 0.999])
def test_a_slew_limit_against_a_finely_followed_wave(ratio: float) -> None:
    points, turns, rate = 20000, 6, ratio
    y, found = 0.0, np.empty(points)
    theta = 2 * np.pi * np.arange(turns * points) / points
    for index, u in enumerate(np.sin(theta)):
        y = min(max(u, y - rate * 2 * np.pi / points), y + rate * 2 * np.pi / points)
        found[index % points] = y
    line = 2 / points * np.sum(found * np.exp(-1j * theta[:points])) / -1j
    formula = closed_form(piece(RateLimiter(limit=rate)))
    assert formula is not None
    assert formula(np.array([1.0]), np.array([1.0]))[0] == pytest.approx(line, abs=2e-3)


@pytest.mark.parametrize("block", KNOWN, ids=lambda block: repr(block))
def test_a_table_is_the_formula(block: Block) -> None:
    part = piece(block)
    table, formula = gain_table(part, np.array([0.1, 100.0])), closed_form(part)
    assert table is not None and formula is not None
    size, omega = np.geomspace(0.05, 50.0, 40), np.full(40, 7.0)
    exact = formula(size, omega)
    off = np.abs(table(size, omega)[0] - exact) / np.abs(exact).max()
    assert np.median(off) < 2e-3 and off.max() < 0.1  # beside the edge of a step or switch it is rough


@pytest.mark.parametrize("block", KNOWN, ids=lambda block: repr(block))
def test_a_later_sine_gives_a_later_answer(block: Block) -> None:
    part = piece(block)
    plain, late = (first_harmonics(part, sines(0.9 * turn))[1][0, 0] for turn in (1.0, np.exp(-0.7j)))
    assert late == pytest.approx(plain * np.exp(-0.7j), rel=1e-9)


def test_a_bias_takes_a_dead_band_away() -> None:
    part = piece(DeadBand(half_width=0.3))
    mean, first = first_harmonics(part, sines(0.2, mean=5.0))
    assert first[0, 0] == pytest.approx(0.2, rel=1e-9) and mean[0, 0] == pytest.approx(4.7, rel=1e-9)
    assert first_harmonics(part, sines(0.2))[1][0, 0] == 0.0


def test_harmonics_of_a_relay() -> None:
    lines = harmonics(piece(Relay(level=1.0)), sines(1.0), (0, 1, 2, 3, 5))[:, 0, 0]
    assert np.abs(lines) == pytest.approx([0, 4 / np.pi, 0, 4 / (3 * np.pi), 4 / (5 * np.pi)], abs=5e-3)


def test_a_piece_of_several_arguments() -> None:
    """x² v of sines in quadrature: (A³ω/4) cos, the describing function of van der Pol's damping."""
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    formula = ca.Function("piece", [ca.vertcat(x, v)], [x**2 * v])
    part = replace(piece(DeadBand(half_width=1.0)), formula=formula, arguments=("x", "v"), block=None)
    given_ = Sines(np.zeros((2, 1)), np.array([[2.0 + 0j], [2j]]), np.array([1.0]))
    assert first_harmonics(part, given_)[1][0, 0] == pytest.approx(2j, abs=1e-12)


SERVO = """
frame = "1 ms"
[signals]
u = "deg"
x = "deg"
[blocks.servo]
type = "second_order"
input = "u"
output = "x"
natural_frequency = "150 rad/s"
damping = 0.5
[[effects]]
type = "rate_limit"
at = "servo.rate"
limit = "60 deg/s"
"""


@pytest.mark.parametrize(("size", "hertz"), [(0.5, 4.0), (2.0, 6.0), (6.0, 3.0)])
def test_a_servo_of_limited_speed_as_it_runs(size: float, hertz: float) -> None:
    """The piece followed over a turn against a run of the loop itself: below, near and far above its limit."""
    loop = build(parse_design(SERVO))
    (part,) = parted(loop).parts
    assert part.name == "rate_limit@servo.rate" and part.memory == 2
    run = simulate(loop, {"u": Sine(amplitude=size, frequency=hertz)}, duration=12 / hertz).record
    last = (run.time >= 8 / hertz) & (run.time < 12 / hertz - 1e-9)
    turn = np.exp(-2j * np.pi * hertz * run.time[last])
    seen = np.mean(run["x"][last] * turn) / np.mean(size * np.sin(2 * np.pi * hertz * run.time[last]) * turn)
    gain = first_harmonics(part, sines(size + 0j, 2 * np.pi * hertz))[1][0, 0] / size
    assert gain == pytest.approx(complex(seen), abs=0.01)
    table = gain_table(part, np.geomspace(1.0, 500.0, 200))
    assert table is not None
    assert table(np.array([size]), np.array([2 * np.pi * hertz]))[0, 0] == pytest.approx(gain, abs=0.06)
