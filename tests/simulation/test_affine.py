"""Calls as matrices against the same calls walked: one truth, to rounding."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from delaytools.signals.expression import Expression
from delaytools.signals.stimulus import Stimulus
from delaytools.simulation import run as runs
from delaytools.simulation.affine import is_affine
from delaytools.simulation.anew import Anew
from delaytools.simulation.compiling import compile_loop
from delaytools.simulation.run import Compiled, run
from delaytools.simulation.sensitivity import run_with_derivatives
from tests.simulation.benches import CASES

AFFINE = {
    "roll", "roll, table delay 15 ms", "roll, command delay 3 ms", "roll, command delay 5 ms", "resonance loop",
    "roll, rate sampled at 2 ms",
}  # fmt: skip
BENT = {"roll, dead band", "roll, saturation", "turntable"}


@contextmanager
def walked() -> Iterator[None]:
    """Every call walked, whatever it is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "FEW", np.inf)
        yield


def compiled(name: str, free: tuple[str, ...] = (), *, short: bool = False) -> Compiled:
    """A case compiled for 4 s."""
    loop, stimuli = CASES[name]
    driven: dict[str, Stimulus] = dict(stimuli)
    return compile_loop(loop, driven, duration=4.0, free=free, short=short)


@pytest.mark.parametrize("name", list(CASES))
def test_a_run_is_the_same_by_matrices(name: str) -> None:
    one = compiled(name)
    rows = run(one)[1]
    with walked():
        known = run(one)[1]
    assert np.abs(rows - known).max() <= 1e-12 * np.abs(known).max()
    if name in AFFINE | BENT:
        assert is_affine(one.call.function) == (name in AFFINE)


@pytest.mark.parametrize(("name", "paths"), [
    ("roll", ("actuator.natural_frequency", "actuator.damping", "motion_table.natural_frequency")),
    ("roll, table delay 15 ms", ("actuator.damping",)),
])  # fmt: skip
def test_derivatives_are_the_same_by_matrices(name: str, paths: tuple[str, ...]) -> None:
    one = compiled(name, paths)
    values = (70.0, 0.6, 80.0)[: len(paths)] if name == "roll" else (0.6,)
    slopes = run_with_derivatives(one, values)[2]
    with walked():
        known = run_with_derivatives(one, values)[2]
    scale = np.abs(known).max(axis=0)
    assert (np.abs(slopes - known).max(axis=0) <= 1e-11 * scale).all() and scale.max() > 0


def test_a_run_that_begins_anew_is_the_same_by_matrices() -> None:
    one = compiled("resonance loop", short=True)
    states = one.model.layout.states
    some = np.array([0.3, *np.full(len(states) - 1, np.nan)])
    anew = (Anew(0, states, np.ones(len(states))), Anew(700, states[:1], some[:1]), Anew(900, states, some))
    found = run_with_derivatives(one, (), anew=anew, starts=states)
    with walked():
        known = run_with_derivatives(one, (), anew=anew, starts=states)
    for rows, other in zip(found[1:], known[1:], strict=True):
        assert np.abs(rows - other).max() <= 1e-11 * np.abs(other).max()


def test_a_large_constant_does_not_hide_what_the_units_do() -> None:
    """A force of 1e9 beside a state of order 1: the units are tried at its scale."""
    loop, stimuli = CASES["resonance loop"]
    pushed = replace(loop.elements[0], inputs={name: Expression("r - y + 1e9") for name in loop.elements[0].inputs})
    far = replace(loop, elements=(pushed, *loop.elements[1:]))
    one = compile_loop(far, stimuli, duration=4.0)
    rows = run(one)[1]
    with walked():
        known = run(one)[1]
    assert np.abs(rows - known).max() <= 1e-12 * np.abs(known).max()


@pytest.mark.parametrize(("formula", "answer"), [
    ("2*p*x + d/p + sin(p)", True), ("x*d", False), ("x**2", False), ("p/x", False), ("fabs(x)", False),
    ("floor(d)", False), ("if_else(x > 0, 1, 2)", False), ("sin(p)*x - d + x + x", True),
])  # fmt: skip
def test_what_is_affine(formula: str, answer: bool) -> None:
    x, d, p = (ca.SX.sym(name) for name in "xdp")
    out = eval(formula, {**vars(ca), "x": x, "d": d, "p": p})
    assert is_affine(ca.Function("f", [x, d, p], [x, out])) is answer
