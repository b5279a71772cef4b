"""The roll loop simulated, compilation included: how many times faster than real time, on one core."""

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from delaytools.design.build import build
from delaytools.design.file import read_design
from delaytools.design.stimuli import design_stimuli
from delaytools.effects.effect import Place
from delaytools.effects.variable_delay import VariableDelayEffect
from delaytools.loop.loop import Loop
from delaytools.loop.port import find_port
from delaytools.simulation.simulate import simulate

DESIGN = Path(__file__).parents[1] / "designs" / "roll_autopilot.toml"
SECONDS = 20.0


def late(loop: Loop, port: str) -> Loop:
    """The loop with a varying delay, 15 ms ± 3 ms at 2 Hz, at a port."""
    effect = VariableDelayEffect(mean=0.015, amplitude=0.003, frequency=2.0)
    return effect.apply(loop, Place(find_port(loop, port), f"variable_delay@{port}", "effects.9"))


CASES: dict[str, tuple[str, Callable[[Loop], Loop], float]] = {
    "constant delay of 15 ms (obc_sensor)": ("obc_sensor", lambda loop: loop, 300.0),
    "constant delay and dead band (complete_hils)": ("complete_hils", lambda loop: loop, 300.0),
    "varying delay at the table": ("obc_in_loop", lambda loop: late(loop, "motion_table.input"), 150.0),
}


@pytest.mark.parametrize("name", CASES)
def test_times_faster_than_real_time(name: str) -> None:
    configuration, change, wanted = CASES[name]
    design = read_design(DESIGN)
    loop = change(build(design, configuration))
    stimuli = design_stimuli(design, loop)
    simulate(loop, stimuli, duration=1.0)
    factors = []
    for _ in range(3):
        begin = time.process_time()
        simulate(loop, stimuli, duration=SECONDS)
        factors.append(SECONDS / (time.process_time() - begin))
    print(f"{name}: {max(factors):.0f} times faster than real time")
    assert max(factors) >= wanted
