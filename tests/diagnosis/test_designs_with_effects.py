"""A design that has effects already, from an earlier `improve`: the next one is found behind, ahead or beside them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import prepared_case
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.search import search
from delaytools.loop.segments import segments
from delaytools.signals.parameter import Parameter
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import ACTUATOR, CHAIN, DRIVE, planted

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


@pytest.mark.parametrize(
    ("designed", "hidden"),
    [("at the exit", "interference"), ("at the exit", "offset"), ("at the entry", "offset"),
     ("between blocks", "play")],
)  # fmt: skip
def test_one_more_effect_is_found(designed: str, hidden: str) -> None:
    true = HIDDEN[hidden]
    found = search(planted(design(designed), (true,), WAVE, exit="y", seconds=3.0), Carried({"u": 0.0}))
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
    found = search(planted(LATE_DRIVE, (true,), WAVE, exit="v", seconds=3.0), Carried({"u": 0.0}))
    (one,) = found.fitted.added
    assert one.key == true.key
    assert found.fitted.by_path["effects.1000.level"].value == pytest.approx(1.5, rel=0.02)


def test_what_an_effect_of_the_design_has_may_be_tolerated() -> None:
    text = LATE_DRIVE.replace('mass = 1.0', 'mass = "2*half"') + "\n[parameters]\nhalf = 0.5\n"
    paths = ("effects.0.delay", "parameters.half", "drive.viscous", "elsewhere.gain")
    part = segments(build(parse_design(text)), {"u", "v"})[0]
    record = Record(np.arange(9.0), {"u": np.zeros(9), "v": np.zeros(9)})
    case = prepared_case(part, (record,), tuple(Parameter(path, 1.0) for path in paths), frozenset())
    assert [p.path for p in case.tolerated] == list(paths[:3])


def test_an_effect_that_one_log_alone_shows_is_named() -> None:
    limit = Added("saturation", "act.input", {"limit": 3.0})
    small, large = (planted(ACTUATOR, (limit,), replace(WAVE, amplitude=a), seconds=3.0) for a in (0.5, 3.0))
    both = {"records": small.records + large.records, "measured": small.measured + large.measured}
    case = replace(small, **both, smooth=frozenset({"u"}), _replays={})
    found = search(case, Carried({"u": 0.0}))
    assert [one.kind for one in found.fitted.added] == ["saturation"]
