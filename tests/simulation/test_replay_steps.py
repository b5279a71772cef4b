"""Runs on logs take the steps that their blocks need: quantisers of moving signals, friction by load."""

from dataclasses import replace

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.signals.record import Record
from delaytools.simulation.replay import LAST, Replay, driven_by
from delaytools.simulation.timing import MOST

ROUNDED = """
frame = "1 ms"
[signals]
r = "deg"
y = "deg"
[blocks.table]
type = "second_order"
input = "r"
output = "y"
natural_frequency = "300 rad/s"
damping = 0.6
[[effects]]
type = "quantization"
at = "table.input"
step = 0.4
"""
RUBBING = """
frame = "1 ms"
[signals]
r = "deg"
y = "deg"
[blocks.actuator]
type = "second_order"
input = "r"
output = "y"
natural_frequency = "160 rad/s"
damping = 0.6
[[effects]]
type = "load_dependent_friction"
at = "actuator.rate'"
coefficient = 0.6
smoothing = 0.5
"""


def replay(text: str, *, frame: float = 1e-3, held: bool = False, substeps: int | None = None) -> Replay:
    time = 1e-3 * np.arange(4001)
    column = 3 * np.sin(2 * np.pi * 1.3 * time) + 1.5 * np.sin(2 * np.pi * 4.1 * time + 1)
    log = Record(time, {"r": column}, {"r": "deg"}, frozenset({"r"} if held else ()))
    loop = replace(build(parse_design(text)), frame=frame)
    return Replay(loop, driven_by(log, {"r"}), time, ("y",), (), (), substeps)


def test_a_quantiser_of_a_moving_signal_jumps_between_rows() -> None:
    found, finest = replay(ROUNDED).run(), replay(ROUNDED, frame=1e-3 / 128).run()
    assert float(np.std(found - finest)) < 4e-3 * 0.4 and float(np.std(finest)) > 1
    assert replay(ROUNDED, held=True).frame == pytest.approx(1e-3)


def test_friction_by_load_gets_steps_for_the_load_that_the_run_brings() -> None:
    found, finest = replay(RUBBING).run(), replay(RUBBING, substeps=100).run()
    coarse = replay(RUBBING, substeps=1).run()
    assert float(np.std(found - finest)) < 1e-4 * float(np.std(finest)) < float(np.std(coarse - finest))


def test_finer_frames_ask_for_no_more_steps_of_a_row() -> None:
    """A quantiser makes eight frames of a row, and friction this stiff asks for as many steps as a frame may have."""
    stiff = RUBBING.replace("load_dependent_friction", "coulomb_friction").replace("coefficient = 0.6", "level = 2e3")
    stiff = stiff.replace("smoothing = 0.5", "smoothing = 0.01")
    coarse = '[[effects]]\ntype = "quantization"\nat = "actuator.input"\nstep = 0.4\n'
    alone, rounded = replay(stiff), replay(stiff + coarse)
    assert rounded.frame < 0.2 * alone.frame
    for one in (alone, rounded):
        one.run()
    assert alone.steps[LAST].max() == MOST
    assert MOST <= rounded.steps[LAST].max() * alone.frame / rounded.frame < 1.1 * MOST
