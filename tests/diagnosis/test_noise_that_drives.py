"""Noise on what drives a segment: read by a computer or not, late or not; and how far chance goes."""

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.diagnosis.heldout import HeldOut
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Multisine
from delaytools.simulation.simulate import simulate
from tests.diagnosis.test_what_hides import CARRIAGE, PUSH, found, named

READER = """
frame = "1 ms"
[signals]
w = "deg"
s = "deg"
u = "V"
[blocks.sensor]
type = "first_order"
input = "w"
output = "s"
time_constant = 0.02
[blocks.computer]
type = "sample_hold"
input = "0.5*s"
output = "u"
period = "2 ms"
"""


@pytest.mark.parametrize("late", [0, 1])
def test_a_computer_reads_the_noise_as_well_some_rows_late(late: int) -> None:
    design = parse_design(READER)
    wave = Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=5.0, lines=20)
    run = simulate(build(design), {"w": wave}, duration=3.0).record
    noisy = run["s"] + 0.05 * np.random.default_rng(3).standard_normal(len(run))
    read = np.concatenate([np.zeros(late), noisy])[: len(noisy)]
    held = np.repeat(0.5 * read[::2], 2)[: len(read)]
    log = Record(run.time, {"w": wave.value(run.time), "s": noisy, "u": held}, {"w": "deg", "s": "deg", "u": "V"})
    answer = diagnose(design, [log], effort=Effort(processes=1))
    if late == 0:
        assert answer.verdict == "adequate"
    else:
        (one,) = answer.missing
        assert (one.effect, one.signal) == ("delay", "u")
        assert one.parameters["delay"].value == pytest.approx(late * 1e-3, abs=2e-6)


def test_a_force_on_a_drive_that_is_far_from_its_log_is_seen_along_the_measured_motion() -> None:
    table = {"type": "quadratic_drag", "at": "drive.w'", "coefficient": -0.4}
    answer = found(CARRIAGE, (table,), {"r": PUSH}, {"x": 0.01, "v": 0.1})
    assert list(named(answer)) == ["quadratic_drag"]
    assert named(answer)["quadratic_drag"]["coefficient"] == pytest.approx(-0.4, rel=0.02)


def test_luck_is_what_the_rows_that_get_worse_say() -> None:
    def of(residual: np.ndarray) -> HeldOut:
        return HeldOut(residual, np.array([float(residual @ residual)]))

    spikes, plain = np.zeros(1000), np.zeros(1000)
    spikes[::100], plain[50::100] = 10.0, 10.0
    gain, _ = of(plain).better_than(of(spikes))
    assert gain == 0.0 and of(plain).luck_beside(of(spikes)) == pytest.approx(np.sqrt(2 * 10) * 100)
    assert of(np.zeros(1000)).luck_beside(of(spikes)) == 0.0
