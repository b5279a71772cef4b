"""A compiled step taken for other delays against one compiled for them: one truth, to rounding."""

import numpy as np
import pytest

from delaytools.blocks.delay import Delay
from delaytools.loop.loop import Loop
from delaytools.loop.values import with_numbers
from delaytools.signals.stimulus import Multisine
from delaytools.simulation.compiling import compile_loop, moved
from delaytools.simulation.replay import Replay
from delaytools.simulation.run import run
from delaytools.simulation.sensitivity import run_with_derivatives
from tests.simulation.benches import ACTUATOR, DOUBLET, TABLE, roll_bench, with_block

SMOOTH = {name: Multisine(amplitude=1.0, from_frequency=0.5, to_frequency=5.0, lines=7) for name in DOUBLET}
TABLES, COMMANDS = "Delay@motion_table.input.delay", "Delay@actuator.input.delay"
DRIVEN = {"grid repeats": DOUBLET, "kinks from the start": SMOOTH}
# free delays, those that the bench is compiled for, and others that look back to the same steps
ALIKE: dict[str, tuple[tuple[str, ...], tuple[float, ...], tuple[float, ...]]] = {
    "of a state": ((TABLES,), (0.0122,), (0.01237,)),
    "of a held signal, whose ticks arrive between rows": ((COMMANDS,), (0.0073,), (0.00737,)),
    "shorter than a step": ((TABLES,), (0.0003,), (0.00032,)),
    "two, one after the other": ((TABLES, COMMANDS), (0.0122, 0.0071), (0.01221, 0.00712)),
}


def bench(paths: tuple[str, ...]) -> Loop:
    loop = roll_bench()
    for path, place in ((TABLES, TABLE), (COMMANDS, ACTUATOR)):
        loop = with_block(loop, place, Delay(delay=0.0122)) if path in paths else loop
    return loop


@pytest.mark.parametrize("case", ALIKE)
@pytest.mark.parametrize("driven", DRIVEN)
@pytest.mark.parametrize("short", [False, True])
def test_a_step_taken_for_other_delays_gives_what_one_compiled_for_them_does(
    case: str, driven: str, short: bool
) -> None:
    (paths, first, then), stimuli = ALIKE[case], DRIVEN[driven]
    free = ("actuator.damping", *paths)
    loops = [with_numbers(bench(paths), dict(zip(paths, delays, strict=True))) for delays in (first, then)]
    one, other = (compile_loop(loop, stimuli, duration=1.2, free=free, short=short) for loop in loops)
    taken = moved(one, (0.6, *then))
    assert taken is not None and taken.call.function is one.call.function
    for k, known in enumerate(run_with_derivatives(other, (0.6, *then), by=(0,))):
        found = run_with_derivatives(taken, (0.6, *then), by=(0,))[k]
        assert np.abs(found - known).max() <= 1e-11 * np.abs(known).max()
    plain = compile_loop(loops[1], stimuli, duration=1.2)
    assert np.abs(run(taken, (0.6, *then))[1] - run(plain)[1]).max() < 1e-10 * np.abs(run(plain)[1]).max()


@pytest.mark.parametrize("delay", [0.0109, 0.0126, 0.013, 0.0301])
def test_a_delay_that_looks_back_to_other_steps_is_compiled_anew(delay: float) -> None:
    loop = bench((TABLES,))
    one = compile_loop(with_numbers(loop, {TABLES: 0.0122}), DOUBLET, duration=1.2, free=(TABLES,))
    assert moved(one, (delay,)) is None


def test_both_kinds_of_call_are_met_above() -> None:
    found = [compile_loop(bench((TABLES,)), stimuli, duration=1.2).call.copies for stimuli in DRIVEN.values()]
    assert found[0] > 0 and found[1] == 0


@pytest.mark.parametrize("delay", [0.01221, 0.01223, 0.01225, 0.00002])
def test_runs_between_delays_are_those_of_the_delay_nearly(delay: float) -> None:
    loop, time = with_numbers(bench((TABLES,)), {TABLES: delay}), 0.001 * np.arange(1200)
    replay = Replay(loop, SMOOTH, time, ("roll_rate", "table_rate"), ("actuator.damping", TABLES), ())
    rows, slopes = replay.run_with_derivatives((0.6, delay))
    found = replay.run_between((0.6, delay))
    assert np.abs(found[0] - rows).max() < (400.0 * 0.001 / 20) ** 2 / 8 * np.abs(rows).max()  # ω of the table
    for k, size in enumerate(np.abs(slopes).max(axis=(0, 1))):
        assert np.abs(found[1][:, :, k] - slopes[:, :, k]).max() < 0.01 * size
