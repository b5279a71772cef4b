"""One segment with a planted effect and its log, small enough that a hypothesis is fitted in a moment."""

import numpy as np

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis.added import Added, with_added
from delaytools.diagnosis.case import Case, prepared_case
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.loop.segments import segments
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column, Stimulus
from delaytools.simulation.simulate import simulate

NOISE = 0.01
ACTUATOR = """
[signals]
u = "deg"
x = "deg"
[blocks.act]
type = "second_order"
input = "u"
output = "x"
natural_frequency = "60 rad/s"
damping = 0.6
"""
CHAIN = (
    ACTUATOR
    + """
[blocks.sensor]
type = "first_order"
input = "x"
output = "y"
time_constant = "5 ms"
"""
)
DRIVE = """
[signals]
u = "N"
v = "m/s"
[blocks.drive]
type = "equations"
inputs = { u = "u" }
states = { v = 0.0 }
parameters = { mass = 1.0, viscous = 8.0 }
rates = { v = "(u - viscous*v)/mass" }
outputs = { v = "v" }
"""
SLIDE = """
[signals]
u = "N"
x = "m"
[blocks.drive]
type = "equations"
inputs = { u = "u" }
states = { x = 0.0, v = 0.0 }
parameters = { mass = 1.0, viscous = 8.0 }
rates = { x = "v", v = "(u - viscous*v)/mass" }
outputs = { x = "x" }
"""


def planted(
    text: str,
    added: tuple[Added, ...],
    stimulus: Stimulus,
    *,
    exit: str = "x",
    noise: float = NOISE,
    seconds: float = 6.0,
) -> Case:
    """The case of the one segment between `u` and the exit, whose log shows the effects and white noise."""
    loop = build(parse_design(text))
    record = simulate(with_added(loop, added), {"u": stimulus}, duration=seconds).record
    measured = record[exit] + noise * np.random.default_rng(3).standard_normal(len(record))
    held = {"u"} if isinstance(stimulus, Column) and stimulus.held else set()
    log = Record(record.time, {"u": record["u"], exit: measured}, held=frozenset(held))
    case = prepared_case(segments(loop, {"u", exit})[0], (log,), (), frozenset())
    return case.whitened_by(noise_of(case, _as_they_are(case, added), Carried({})))


def _as_they_are(case: Case, added: tuple[Added, ...]) -> Fitted:
    return Fitted(added, case.parameters(added), np.zeros(0), np.zeros((0, len(case.parameters(added)))))


def fitted(case: Case, *added: Added) -> Fitted:
    """A hypothesis fitted to the case."""
    return fit_hypothesis(case, added)
