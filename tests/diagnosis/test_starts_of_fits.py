"""Where fits begin: the swing of a delay, one effect beside another; and noise through a quantiser."""

import numpy as np
import pytest

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.joint_start import making_room
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.screen import base_of
from delaytools.diagnosis.swings import swings
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import ACTUATOR, fitted, planted

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)


def test_the_swing_of_a_delay_is_seen_beside_its_mean() -> None:
    true = {"mean": 0.006, "amplitude": 0.003, "frequency": 0.8, "phase": 0.5}
    case = planted(ACTUATOR, (Added("variable_delay", "act.input", true),), WAVE)
    found = swings(base_of(case, fitted(case)), spots(case.segment))
    best = max(found, key=lambda one: one.gain)
    assert best.added.at == "act.input"
    for name, within in (("mean", 0.001), ("amplitude", 0.0005), ("frequency", 0.05), ("phase", 0.4)):
        assert best.added.values[name] == pytest.approx(true[name], abs=within)


def test_a_constant_delay_has_no_swing() -> None:
    case = planted(ACTUATOR, (Added("delay", "act.input", {"delay": 0.006}),), WAVE)
    assert not swings(base_of(case, fitted(case)), spots(case.segment))


def test_a_gain_makes_room_for_a_leak() -> None:
    gain = Added("scale_factor", "act.output", {"factor": 1.2})
    leak = Added("cross_coupling", "act.output", {"gain": 0.3}, {"source": "u"})
    case = planted(ACTUATOR, (gain, leak), WAVE)
    alone = fitted(case, gain)
    room = making_room(base_of(case, alone), leak)
    assert alone.added[0].values["factor"] > 1.4
    assert room is not None and room[0][1] == leak
    assert room[0][0].values["factor"] == pytest.approx(1.2, abs=0.01)


def test_a_little_noise_through_a_quantiser_is_more_than_its_share() -> None:
    rounded = Added("quantization", "act.input", {"step": 0.5})
    case = planted(ACTUATOR, (rounded,), WAVE)
    plain, coarse = fitted(case), fitted(case, rounded)
    carried = Carried({"u": 0.02})
    straight, bent = (
        float(np.std(carried.through(case, one, share=0.1)[0]) / np.std(carried.through(case, one)[0]))
        for one in (plain, coarse)
    )
    assert straight == pytest.approx(0.1, rel=1e-6) and bent > 1.5 * straight
