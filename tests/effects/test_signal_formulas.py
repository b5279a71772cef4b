"""Effects on signals against NumPy and SciPy: the column behind the effect, computed from the column before it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from delaytools.effects.delay import DelayEffect
from delaytools.effects.dropped_frames import DroppedFramesEffect
from delaytools.loop.loop import Loop
from tests.effects.family import SIGNAL
from tests.effects.servo import DRAWS, LATE, PERIOD, placed, rows, servo

Array = NDArray[np.float64]
Columns = dict[str, Array]


def late(c: Columns, seconds: Array | float) -> Array:
    """The column `seconds` ago; before t = 0 its first value."""
    return CubicSpline(c["t"], c["measured"])(np.maximum(c["t"] - seconds, 0.0))


def first_order(c: Columns) -> Array:
    """0.03 y' = u - y."""
    u = CubicSpline(c["t"], c["measured"])
    return integrate(lambda t, y: (u(t) - y) / 0.03, [0.0], c["t"])[0]


def mode(c: Columns) -> Array:
    """u + gain ω s / (s² + 2ζω s + ω²) source."""
    w, source = 2 * np.pi * 9.0, CubicSpline(c["t"], c["position"])
    _, speed = integrate(
        lambda t, z: [z[1], w * source(t) - 0.1 * w * z[1] - w**2 * z[0]], [0.0, 0.0], c["t"]
    )
    return c["measured"] + 0.3 * speed


def integrate(formula: Callable, start: list[float], t: Array) -> Array:
    """States at t by an 8th-order method of its own."""
    return solve_ivp(formula, (0, t[-1]), start, "DOP853", t, rtol=1e-11, atol=1e-12, max_step=0.01).y


def play(c: Columns) -> Array:
    """The play operator, row by row."""
    y, found = c["measured"][0], []
    for u in c["measured"]:
        y = min(max(y, u - 0.1), u + 0.1)
        found.append(y)
    return np.array(found)


def slewed(c: Columns) -> Array:
    """The slew limit, row by row."""
    y, found, reach = c["measured"][0], [], 3.0 * 1e-3
    for u in c["measured"]:
        y += min(max(u - y, -reach), reach)
        found.append(y)
    return np.array(found)


def ticks(t: Array, period: float) -> NDArray[np.int64]:
    """The number of the last tick at or before t."""
    return np.floor(t / period + 1e-9).astype(int)


def held(c: Columns) -> Array:
    """The column at the last tick."""
    k = ticks(c["t"], 0.007)
    return c["measured"][np.round(0.007 * k / 1e-3).astype(int)]


def gained(start: float, end: float) -> Callable[[Columns], Array]:
    """Half of the column between start and end."""
    return lambda c: c["measured"] * np.where((c["t"] >= start - 1e-9) & (c["t"] < end - 1e-9), 0.5, 1.0)


def tone(c: Columns) -> Array:
    """Interference."""
    return c["measured"] + 0.05 * np.sin(2 * np.pi * 12.0 * c["t"] - 1.0)


# name: formula, largest difference allowed (exact ones to rounding, the others to the spline through 1 ms rows)
FORMULAS: dict[str, tuple[Callable[[Columns], Array], float]] = {
    "delay": (lambda c: late(c, 0.0123), 1e-7),
    "variable delay": (lambda c: late(c, 0.02 + 0.006 * np.sin(2 * np.pi * 1.7 * c["t"] + 0.3)), 1e-7),
    "delay from a column": (lambda c: late(c, np.interp(c["t"], LATE.time, LATE.values)), 1e-7),
    "lag": (first_order, 1e-7),
    "dead band": (lambda c: c["measured"] - np.clip(c["measured"], -0.1, 0.1), 1e-15),
    "backlash": (play, 1e-14),
    "saturation": (lambda c: np.clip(c["measured"], -0.4, 0.4), 1e-15),
    "rate limit": (slewed, 1e-12),
    "quantization": (lambda c: 0.05 * np.floor(c["measured"] / 0.05 + 0.5), 1e-15),
    "sample hold": (held, 1e-15),
    "scale factor": (lambda c: 1.2 * c["measured"], 1e-15),
    "bias": (lambda c: c["measured"] - 0.1, 1e-15),
    "gain drift": (lambda c: (1 - 0.2 * c["t"]) * c["measured"], 1e-14),
    "transient gain": (gained(0.4, 0.9), 1e-15),
    "transient gain between frames": (gained(0.40037, 0.90051), 1e-15),
    "interference": (tone, 1e-13),
    "flexible mode": (mode, 1e-6),
    "coupling": (lambda c: c["measured"] + 0.2 * c["gust"], 1e-15),
    "formula": (lambda c: c["measured"] + 0.3 * c["measured"] * np.abs(c["measured"]), 1e-12),
    "formula with time and a signal": (lambda c: c["measured"] * (1 + 0.1 * c["t"]) + 0.2 * c["gust"] ** 2, 1e-12),
}


@pytest.mark.parametrize("name", SIGNAL)
@pytest.mark.parametrize("at", ["probe.output", "probe.input"])
def test_the_formula(name: str, at: str) -> None:
    loop = placed(servo(), SIGNAL[name], at)
    run = rows(replace(loop, units={"gust": ""}))
    formula, allowed = FORMULAS[name]
    assert np.max(np.abs(run["probed"] - run["measured"])) > 0.02
    assert np.max(np.abs(run["probed"] - formula(run))) < allowed


def step_error(loop: Loop) -> float:
    """How far a run lies from one with 16 times finer steps."""
    coarse, fine = rows(loop), rows(loop, substeps=16)
    return float(np.max(np.abs(coarse["position"] - fine["position"])))


@pytest.mark.parametrize("name", ["delay", "lag", "gain drift", "interference", "flexible mode"])
def test_the_loop_behind_it_agrees_with_finer_steps(name: str) -> None:
    assert step_error(placed(servo(), SIGNAL[name], "actuator.input")) < 1e-7


@pytest.mark.parametrize("name", ["transient gain", "transient gain between frames"])
@pytest.mark.parametrize("later", [0.0, 0.0123])
def test_a_jump_of_gain_falls_between_steps(name: str, later: float) -> None:
    loop = placed(servo(), SIGNAL[name], "actuator.input")
    assert step_error(placed(loop, DelayEffect(delay=later), "actuator.input", 1)) < 1e-7


def test_dropped_frames_keep_the_value_before() -> None:
    run = rows(placed(servo("sampled"), DroppedFramesEffect(probability=0.3), "sampler.output"))
    k = ticks(run["t"], PERIOD)
    sent, value, expected = run["probed"][:: round(PERIOD / 1e-3)], 0.0, []
    for update, draw in zip(sent, DRAWS, strict=False):
        value = value if draw < 0.3 else update
        expected.append(value)
    assert np.array_equal(run["sampled"], np.array(expected)[k])
    assert 0.2 < np.mean(DRAWS[: len(sent)] < 0.3) < 0.4
