"""Friction gets many steps where it is stiff, one elsewhere, and its run is that of many steps everywhere."""

import numpy as np
import pytest

from delaytools.effects.coulomb_friction import CoulombFrictionEffect
from delaytools.effects.load_dependent_friction import LoadDependentFrictionEffect
from delaytools.loop.loop import Loop
from delaytools.signals.stimulus import Sine
from delaytools.simulation.compiling import Pace, compile_loop
from delaytools.simulation.run import Compiled, run
from delaytools.simulation.sensitivity import run_with_derivatives
from tests.effects.servo import drive, placed

STIMULI = {"demand": Sine(amplitude=3.0, frequency=1.3)}
DURATION = 2.0
RUBBING = {
    "coulomb": (CoulombFrictionEffect(level=20.0, smoothing=0.005), "level", 1e-4),
    "by load": (LoadDependentFrictionEffect(coefficient=0.6, smoothing=0.01), "coefficient", 1e-3),
}


def rubbing(kind: str) -> Loop:
    effect = RUBBING[kind][0]
    return placed(drive(), effect, "drive.v'")


def spans(compiled: Compiled) -> int:
    """Runge–Kutta steps of a run."""
    call = compiled.call
    return len(call.grid.start) if call.copies == 0 else compiled.frames * call.spans // call.rows


@pytest.mark.parametrize("kind", RUBBING)
def test_few_steps_give_the_run_of_many(kind: str) -> None:
    own = compile_loop(rubbing(kind), STIMULI, duration=DURATION)
    same = compile_loop(rubbing(kind), STIMULI, duration=DURATION, substeps=100)
    off = np.abs(run(own)[1] - run(same)[1]).max(axis=0) / np.abs(run(same)[1]).max(axis=0)
    assert off.max() < RUBBING[kind][2]
    most = int(own.call.grid.length.max() / own.call.grid.length.min() + 0.5)
    assert most > 3 and spans(own) < 0.5 * most * own.frames


@pytest.mark.parametrize("kind", RUBBING)
def test_they_are_finer_where_that_is_asked_for(kind: str) -> None:
    usual, finer = (compile_loop(rubbing(kind), STIMULI, duration=DURATION, pace=Pace(finer=n)) for n in (1, 4))
    assert spans(finer) == 4 * spans(usual)
    exact = run(compile_loop(rubbing(kind), STIMULI, duration=DURATION, substeps=200))[1]
    errors = [np.abs(run(one)[1] - exact).max() for one in (usual, finer)]
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("kind", RUBBING)
def test_derivatives_are_those_of_the_run(kind: str) -> None:
    path, value = f"effects.0.{RUBBING[kind][1]}", getattr(RUBBING[kind][0], RUBBING[kind][1])
    compiled = compile_loop(rubbing(kind), STIMULI, duration=DURATION, free=(path,))
    _, rows, slopes = run_with_derivatives(compiled, (value,))
    assert rows == pytest.approx(run(compiled, (value,))[1], abs=1e-12)
    step = 1e-6 * value
    ends = [run(compiled, (value + side,))[1] for side in (step, -step)]
    found = (ends[0] - ends[1]) / (2 * step)
    assert slopes[:, :, 0] == pytest.approx(found, abs=1e-4 * np.abs(found).max())


def test_a_loop_that_is_as_stiff_everywhere_has_one_grid() -> None:
    compiled = compile_loop(drive(), STIMULI, duration=DURATION)
    assert compiled.call.copies > 0


def test_every_frame_begins_with_a_row() -> None:
    compiled = compile_loop(rubbing("coulomb"), STIMULI, duration=DURATION)
    kept = compiled.call.grid.start[compiled.call.grid.row]
    assert kept == pytest.approx(compiled.frame * np.arange(len(kept)), abs=1e-12)
