"""What enters a computer and depends on time is read at the time of its tick."""

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.design.edit import with_effect
from delaytools.signals.stimulus import Sine
from delaytools.simulation.simulate import simulate

TEXT = """
frame = "1 ms"
[signals]
u = "V"
y = "V"
[blocks.computer]
type = "sample_hold"
input = "2*u"
output = "y"
period = "4 ms"
"""
WAVE = Sine(amplitude=1.0, frequency=1.0)
EFFECTS = {
    "gain_drift": ({"rate": "0.5 1/s"}, lambda t, u: (1 + 0.5 * t) * u),
    "transient_gain": (
        {"factor": 0.5, "start": "0.5 s", "end": "0.7 s"},
        lambda t, u: np.where((t > 0.499) & (t < 0.699), 0.5, 1.0) * u,
    ),
    "periodic_interference": (
        {"amplitude": "0.3 V", "frequency": "5 Hz", "phase": 0.4},
        lambda t, u: u + 0.3 * np.sin(10 * np.pi * t + 0.4),
    ),
}


@pytest.mark.parametrize("kind", EFFECTS)
def test_an_effect_in_time_at_the_input_of_a_computer(kind: str) -> None:
    values, formula = EFFECTS[kind]
    loop = build(with_effect(parse_design(TEXT), {"type": kind, "at": "computer.input", **values}))
    run = simulate(loop, {"u": WAVE}, duration=1.0).record
    tick = 0.004 * np.floor(run.time / 0.004 + 1e-9)
    assert run["y"] == pytest.approx(formula(tick, 2 * WAVE.value(tick)), abs=1e-12)
