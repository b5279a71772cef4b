"""A design that has effects already, from an earlier `improve`: the next one is found behind, ahead or beside them."""

import math

import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.search import search
from delaytools.loop.segments import segments
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import CHAIN, DRIVE, planted

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)
DESIGNED = {
    "at the exit": """type = "periodic_interference"
at = "sensor.output"
amplitude = 0.3
frequency = "7 Hz"
phase = 0.3""",
    "at the entry": """type = "lag"
at = "act.input"
time_constant = "8 ms\"""",
    "between blocks": """type = "bias"
at = "act.output"
level = "0.4 deg\"""",
}
HIDDEN = {
    "offset": Added("bias", "sensor.output", {"level": 0.3}),
    "interference": Added(
        "periodic_interference", "sensor.output", {"amplitude": 0.2, "frequency": 2 * math.pi * 3.1, "phase": 1.0}
    ),
    "play": Added("backlash", "act.input", {"half_width": 0.25}),
}


LATE_DRIVE = f"""{DRIVE}
[[effects]]
type = "delay"
at = "drive.u"
delay = "5 ms"
"""


def design(which: str) -> str:
    return f"{CHAIN}\n[[effects]]\n{DESIGNED[which]}\n"


@pytest.mark.parametrize("hidden", HIDDEN)
@pytest.mark.parametrize("designed", DESIGNED)
def test_one_more_effect_is_found(designed: str, hidden: str) -> None:
    true = HIDDEN[hidden]
    found = search(planted(design(designed), (true,), WAVE, exit="y"), Carried({"u": 0.0}))
    (one,) = found.fitted.added
    assert one.kind == true.kind and found.case.exit_at(one.at) == found.case.exit_at(true.at)
    for name, value in true.values.items():
        assert found.fitted.by_path[f"effects.1000.{name}"].value == pytest.approx(value, rel=0.03)


@pytest.mark.parametrize("designed", DESIGNED)
def test_effects_of_the_design_change_no_place(designed: str) -> None:
    plain, other = (segments(build(parse_design(text)), {"u", "y"})[0] for text in (CHAIN, design(designed)))
    assert spots(plain) == spots(other)


def test_a_force_is_found_behind_a_delay_of_the_design() -> None:
    true = Added("coulomb_friction", "drive.v'", {"level": 1.5, "smoothing": 0.01})
    found = search(planted(LATE_DRIVE, (true,), WAVE, exit="v"), Carried({"u": 0.0}))
    (one,) = found.fitted.added
    assert one.key == true.key
    assert found.fitted.by_path["effects.1000.level"].value == pytest.approx(1.5, rel=0.02)
