"""A hint finds a planted term again, names where it acts, and says nothing of noise."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.hint import hint
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import ACTUATOR, DRIVE, NOISE, fitted, planted

Array = NDArray[np.float64]
INPUT = Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=8.0, lines=20)


def plain(text: str = ACTUATOR, exit: str = "x", *added: Added) -> Case:
    """A case with effects that no hypothesis will hold."""
    case = planted(text, added, INPUT, exit=exit, seconds=10.0)
    null = fitted(case)
    return case.whitened_by(noise_of(case, null, Carried({})))


def with_residual(case: Case, change: Callable[[Array, Array, Array], Array]) -> Case:
    """The case with a term of t, u and x added to what was measured."""
    record = case.records[0]
    exit = case.measured[0][:, 0]
    clean = case.outputs((), ())[0][:, 0]
    return replace(case, measured=((exit + change(record.time, record["u"], clean))[:, None],), _replays={})


AT_EXIT: dict[str, Callable[[Array, Array, Array], Array]] = {
    "sign(u)·sqrt|u|": lambda t, u, x: -0.3 * np.sign(u) * np.sqrt(np.abs(u)),
    "|u|": lambda t, u, x: 0.2 * np.abs(u),
    "u²": lambda t, u, x: 0.1 * u**2,
    "x³": lambda t, u, x: 0.02 * x**3,
    "x·|x|": lambda t, u, x: -0.05 * x * np.abs(x),
    "d(x)/dt·|d(x)/dt|": lambda t, u, x: 5e-5 * np.gradient(x, 1e-3) * np.abs(np.gradient(x, 1e-3)),
}


@pytest.mark.parametrize("name", AT_EXIT)
def test_a_planted_term_is_suggested(name: str) -> None:
    case = with_residual(plain(), AT_EXIT[name])
    begin = time.monotonic()
    words = hint(case, fitted(case), 0)
    assert time.monotonic() - begin < 10
    assert f"·{name}" in words and "the residual at x looks like " in words
    assert words.endswith("of resamples): a suggestion, not a finding")


def test_a_growing_gain_is_a_product_with_time() -> None:
    """At the exit, or of the input through the segment: the same to the eye."""
    case = with_residual(plain(), lambda t, u, x: 0.02 * t * x)
    words = hint(case, fitted(case), 0)
    assert "·t·x (" in words or "·t·u at act.rate' would do" in words


def test_its_factor_is_told() -> None:
    case = with_residual(plain(), AT_EXIT["sign(u)·sqrt|u|"])
    assert "looks like -0.3·sign(u)·sqrt|u| (stable in " in hint(case, fitted(case), 0)


FORCES = {
    "x³": (ACTUATOR, "x", Added("cubic_stiffness", "act.rate'", {"coefficient": -40.0}), "act.rate'"),
    "v·|v|": (DRIVE, "v", Added("quadratic_drag", "drive.v'", {"coefficient": -30.0}), "drive.v'"),
    "sign(d(x)/dt)": (
        ACTUATOR,
        "x",
        Added("coulomb_friction", "act.rate'", {"level": 300.0, "smoothing": 1.0}),
        "act.rate'",
    ),
}


@pytest.mark.parametrize("name", FORCES)
def test_a_force_is_suggested_where_it_acts(name: str) -> None:
    text, exit, effect, at = FORCES[name]
    case = plain(text, exit, effect)
    words = hint(case, fitted(case), 0)
    assert f"·{name} at {at} would do" in words


@pytest.mark.parametrize("seed", range(4))
def test_noise_says_nothing(seed: int) -> None:
    case = plain()
    clean = case.outputs((), ())[0]
    white = NOISE * np.random.default_rng(seed).standard_normal(clean.shape)
    assert hint(replace(case, measured=(clean + white,), _replays={}), fitted(case), 0) == ""
