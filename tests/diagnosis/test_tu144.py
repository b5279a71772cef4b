"""The trap of the Tu-144 flight data: a slow lag before the aircraft, which a delayed second order fits very well.

Source: T. Curry, NASA Tu-144LL handling qualities: a lag pole at 0.98 rad/s before ω 4.3 rad/s, ζ 0.6 is fitted by
a delay of 0.12 s and ω 2.9 rad/s (a third too low), with an excellent match in time.
"""

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.estimation.low_order import fit
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column
from delaytools.simulation.simulate import simulate

POLE, OMEGA = 0.98, 4.3  # rad/s
NOISE = 0.005  # deg/s
DESIGN = """
frame = "40 ms"
[signals]
stick = "deg"
rate = "deg/s"
[blocks.aircraft]
type = "second_order"
input = "stick"
output = "rate"
natural_frequency = "4.3 rad/s"
damping = 0.6
[tolerance]
"aircraft.natural_frequency" = "60 %"
"aircraft.damping" = "90 %"
"aircraft.gain" = "50 %"
"""
LAG = f"""
[blocks.prefilter]
type = "first_order"
input = "stick"
output = "slow_stick"
time_constant = "{1 / POLE} s"
"""


def _flight() -> Record:
    """A doublet, a pulse and a sweep through the slow prefilter, the rate with white noise."""
    time = np.arange(0, 24, 0.04)
    stick = np.where((time > 1) & (time < 3), 1.0, 0.0) - np.where((time > 3) & (time < 4.5), 1.0, 0.0)
    stick += np.where((time > 8) & (time < 9), 0.5, 0.0)
    stick += np.where(time > 13, 0.5 * np.sin(0.1 * (time - 13) ** 2), 0.0)
    truth = build(parse_design(DESIGN.replace('"stick"\n', '"slow_stick"\n') + LAG))
    run = simulate(truth, {"stick": Column(time=time, values=stick)}, duration=23.9).record
    rate = run["rate"] + NOISE * np.random.default_rng(1).standard_normal(len(run))
    return Record(run.time, {"stick": run["stick"], "rate": rate}, {"stick": "deg", "rate": "deg/s"})


def test_the_lag_is_named_and_no_delay() -> None:
    log = _flight()
    trap = fit(log, "stick", "rate", delay=True)
    assert trap.cost < 2e-3 and trap.delay > 0.1
    assert trap.natural_frequency < 0.7 * OMEGA

    found = diagnose(parse_design(DESIGN), [log], effort=Effort(processes=1))
    assert found.verdict == "missing" and not found.confusable
    assert [(one.effect, one.at, one.certain) for one in found.missing] == [("lag", "aircraft.input", True)]
    assert found.missing[0].parameters["time_constant"].value == pytest.approx(1 / POLE, rel=0.02)
    assert found.tolerated["aircraft.natural_frequency"].value == pytest.approx(OMEGA, rel=0.02)
    assert found.tolerated["aircraft.damping"].value == pytest.approx(0.6, abs=0.02)
