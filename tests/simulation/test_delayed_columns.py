"""Delays of columns: the column read earlier equals the delay with the history of its steps."""

from collections.abc import Callable

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column, Sine
from delaytools.simulation import replay as module
from delaytools.simulation.replay import Replay, driven_by

LOOP = """
frame = "1 ms"
[signals]
command = "deg"
position = "deg"
[blocks.actuator]
type = "second_order"
input = "command"
output = "position"
natural_frequency = "160 rad/s"
damping = 0.6
[[effects]]
type = "delay"
at = "actuator.input"
delay = "5.13 ms"
"""
BEHIND = {
    "nothing": "",
    "another delay": '[[effects]]\ntype = "delay"\nat = "actuator.input"\ndelay = "1.7 ms"\n',
    "backlash": '[[effects]]\ntype = "backlash"\nat = "actuator.input"\nhalf_width = 0.2\n',
    "friction": '[[effects]]\ntype = "coulomb_friction"\nat = "actuator.rate\'"\nlevel = 3000.0\nsmoothing = 0.5\n',
}
FREE = ("effects.0.delay", "actuator.damping")
TIME = 1e-3 * np.arange(301)


def log(seed: int) -> Record:
    walk = 0.3 * np.cumsum(np.random.default_rng(seed).normal(size=len(TIME)))
    return Record(TIME, {"command": walk}, {"command": "deg"}, frozenset({"command"}))


def replay(behind: str, held: bool, substeps: int | None = None) -> Replay:
    """The actuator on a column that is held or smooth."""
    column = Column(time=TIME, values=log(1)["command"], held=held, before=0.0 if held else None, smooth=not held)
    return Replay(build(parse_design(LOOP + behind)), {"command": column}, TIME, ("position",), FREE, (), substeps)


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("behind", BEHIND.values(), ids=BEHIND)
def test_a_column_read_earlier_equals_the_history_of_its_steps(
    behind: str, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On one grid to rounding; with finer steps where the history has boundaries more, of what arrives between two
    delays."""
    substeps = (8 if held else 64) if behind == BEHIND["another delay"] else None
    values = [(5.13e-3, 0.6), (5.2e-3, 0.61), (4e-3, 0.6), (0.0, 0.6)]
    short = replay(behind, held, substeps)
    found = [short.run(one) for one in values]
    between = short.run_between((5.13e-3, 0.6)) if held else ()
    monkeypatch.setattr(module, "delayed_columns", lambda *_: ())
    long = replay(behind, held, substeps)
    for rows, one in zip(found, values, strict=True):
        truth = long.run(one)
        assert np.abs(rows - truth).max() < 1e-9 * np.abs(truth).max()
    for rows, truth in zip(between, long.run_between((5.13e-3, 0.6)), strict=False):
        assert np.abs(rows - truth).max() < 1e-7 * np.abs(truth).max()  # a slope is a chord of a twentieth of a row


def test_another_delay_of_a_column_compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[int] = []
    counted: Callable[..., object] = module.compile_loop

    def compile_loop(*args: object, **kwargs: object) -> object:
        compiled.append(1)
        return counted(*args, **kwargs)

    monkeypatch.setattr(module, "compile_loop", compile_loop)
    one = replay(BEHIND["friction"], held=True)
    assert not np.array_equal(one.run((5.13e-3, 0.6)), one.run((2.345e-3, 0.6)))
    assert len(compiled) == 1


def test_other_rows_in_the_place_of_a_delayed_column_are_delayed_as_well() -> None:
    driven = driven_by(log(2), {"command"}, at_rest={"command"})
    one = replay("", held=True)
    other = Replay(one.loop, driven, TIME, ("position",), FREE)
    values = (5.13e-3, 0.6)
    assert np.abs(one.run_driven(values, driven) - other.run(values)).max() < 1e-12 * np.abs(other.run(values)).max()
    assert not np.allclose(one.run(values), other.run(values))
    wave = {"command": Sine(amplitude=2.0, frequency=3.0)}
    truth = Replay(one.loop, wave, TIME, ("position",), FREE, (), 8).run(values)
    assert np.abs(replay("", held=True, substeps=8).run_driven(values, wave) - truth).max() < 1e-6 * np.abs(truth).max()
