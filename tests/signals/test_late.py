"""Signals some seconds later: every kind of stimulus, its jumps, and what it is before it begins."""

import numpy as np
import pytest

from delaytools.signals.expression import Expression
from delaytools.signals.stimulus import Column, Doublet, Formula, Multisine, Pulse, Sine, Step, Stimulus, Zero

ROWS = np.arange(0.0, 3.0, 0.1)
KINDS: dict[str, Stimulus] = {
    "nothing": Zero(),
    "step": Step(amplitude=2.0, start=0.4),
    "pulse": Pulse(amplitude=1.0, start=0.2, width=0.3),
    "doublet": Doublet(amplitude=1.0, start=0.2, width=0.3),
    "sine": Sine(amplitude=1.5, frequency=0.7),
    "multisine": Multisine(amplitude=1.0, from_frequency=0.3, to_frequency=2.0, lines=5),
    "formula": Formula(formula=Expression("cos(3*t) + t")),
    "held rows": Column(time=ROWS, values=np.cos(5 * ROWS), held=True, before=0.25),
    "rows": Column(time=ROWS, values=np.cos(5 * ROWS)),
    "smooth rows": Column(time=ROWS, values=np.cos(5 * ROWS), smooth=True),
}


@pytest.mark.parametrize("stimulus", KINDS.values(), ids=KINDS)
def test_a_signal_some_seconds_later(stimulus: Stimulus) -> None:
    late = stimulus.late(0.3137)
    t = np.linspace(0.01, 2.5, 777)
    assert late.value(t + 0.3137) == pytest.approx(stimulus.value(t), abs=1e-12)
    early = np.linspace(0.0, 0.3, 11)
    assert late.value(early) == pytest.approx(stimulus.value(np.full(11, -1e-9)), abs=1e-12)
    begins = (0.0,) if isinstance(stimulus, Column) and not stimulus.jumps else ()  # a kink is met by a step as well
    assert np.asarray(late.jumps) == pytest.approx(np.asarray((*begins, *stimulus.jumps)) + 0.3137)
