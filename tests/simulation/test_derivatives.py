"""One definition per block: the compiled step's CasADi derivative equals finite differences of whole runs."""

from dataclasses import replace

import numpy as np
import pytest

from delaytools.blocks.dead_band import DeadBand
from delaytools.blocks.delay import Delay, VariableDelay
from delaytools.loop.loop import Loop
from delaytools.loop.values import value_paths
from delaytools.signals.stimulus import Stimulus
from delaytools.simulation.compiling import compile_loop
from delaytools.simulation.run import run
from delaytools.simulation.sensitivity import run_with_derivatives
from tests.simulation.benches import ACTUATOR, CASES, DOUBLET, TABLE, roll_bench, turntable, with_block

DELAYED = "Delay@motion_table.input.delay"
HELD = "Delay@actuator.input.delay"


def bench(table: float = 0.0, command: float = 0.0) -> Loop:
    """The roll bench with delays at the table and at the command."""
    loop = roll_bench()
    loop = with_block(loop, TABLE, Delay(delay=table)) if table else loop
    return with_block(loop, ACTUATOR, Delay(delay=command)) if command else loop


def finite_differences(loop: Loop, stimuli: dict[str, Stimulus], path: str, step: float) -> np.ndarray:
    """(rows, signals) by central differences of two whole runs."""
    value = value_paths(loop)[path]
    tables = []
    for moved in (value - step, value + step):
        changed = compile_loop(_with(loop, path, moved), stimuli, duration=1.2)
        tables.append(run(changed)[1])
    return (tables[1] - tables[0]) / (2 * step)


def _with(loop: Loop, path: str, value: float) -> Loop:
    element, _, name = path.rpartition(".")
    if element == "parameters":
        return replace(loop, parameters={**loop.parameters, name: value})
    found = loop[element]
    block = found.block
    changes = (
        {"parameters": {**block.parameters, name: value}} if hasattr(block, "formulas") else {name: value}
    )
    return loop.replaced(replace(found, block=replace(block, **changes)))


CASES_OF_VALUES = [
    (bench(), "actuator.natural_frequency", 1e-2),
    (bench(), "actuator.damping", 1e-4),
    (bench(), "parameters.kp", 1e-6),
    (bench(0.015), "gyro.damping", 1e-4),
    (bench(0.0123), "parameters.kphi", 1e-5),
    (bench(0.0004), "motion_table.damping", 1e-4),
    (bench(0.0123), DELAYED, 1e-6),
    (bench(0.0151), DELAYED, 1e-6),
    (bench(0.0, 0.0073), HELD, 1e-6),
    (bench(0.0123, 0.0073), HELD, 1e-6),
]


@pytest.mark.parametrize(("loop", "path", "step"), CASES_OF_VALUES, ids=lambda item: str(item)[:40])
def test_derivative_equals_finite_differences(loop: Loop, path: str, step: float) -> None:
    compiled = compile_loop(loop, DOUBLET, duration=1.2, free=(path,))
    _, rows, derivative = run_with_derivatives(compiled, (value_paths(loop)[path],))
    plain = run(compile_loop(loop, DOUBLET, duration=1.2))[1]
    assert np.max(np.abs(rows - plain)) < 1e-9 * np.max(np.abs(plain))
    expected = finite_differences(loop, DOUBLET, path, step)
    scale = np.max(np.abs(expected), axis=0) + 1e-9 * np.max(np.abs(expected))
    assert np.max(np.abs(derivative[:, :, 0] - expected) / scale) < 1e-4


def test_derivatives_through_a_nonlinear_block() -> None:
    loop, stimuli = CASES["turntable"]
    for path, step in (("drive.viscous", 1e-4), ("parameters.kd", 1e-6)):
        compiled = compile_loop(loop, stimuli, duration=1.2, free=(path,), substeps=8)
        _, _, derivative = run_with_derivatives(compiled, (value_paths(turntable())[path],))
        below, above = (
            run(
                compile_loop(
                    _with(loop, path, value_paths(loop)[path] + s), stimuli, duration=1.2, substeps=8
                )
            )[1]
            for s in (-step, step)
        )
        expected = (above - below) / (2 * step)
        scale = np.max(np.abs(expected), axis=0) + 1e-9
        assert np.max(np.abs(derivative[:, :, 0] - expected) / scale) < 1e-3


def test_derivatives_with_a_varying_delay_elsewhere() -> None:
    loop = with_block(roll_bench(), TABLE, VariableDelay(mean=0.015, amplitude=0.003, frequency=2.0))
    loop = with_block(loop, ACTUATOR, DeadBand(half_width=0.05))
    path = "actuator.damping"
    compiled = compile_loop(loop, DOUBLET, duration=1.2, free=(path,))
    _, _, derivative = run_with_derivatives(compiled, (0.6,))
    expected = finite_differences(loop, DOUBLET, path, 1e-4)
    scale = np.max(np.abs(expected), axis=0) + 1e-9 * np.max(np.abs(expected))
    assert np.max(np.abs(derivative[:, :, 0] - expected) / scale) < 1e-3
