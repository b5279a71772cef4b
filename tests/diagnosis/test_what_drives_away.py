"""Forces that drive a segment away from where its own log was: no run of the segment alone stays on it."""

from dataclasses import replace

import numpy as np

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis.added import Added, with_added
from delaytools.diagnosis.case import Case, prepared_case
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.diagnosis.driving import nominal
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis
from delaytools.diagnosis.noise import wiener_part
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.diagnosis.nuisance import with_nuisance_of
from delaytools.loop.segments import segments
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Sine
from delaytools.simulation.simulate import simulate

SERVO = """
frame = "1 ms"
[signals]
demand = "deg"
u = "V"
q = "deg"
v = "deg/s"
[blocks.controller]
type = "sample_hold"
input = "1.0*(demand - q) - 0.05*v"
output = "u"
period = "2 ms"
[blocks.drive]
type = "equations"
inputs = { u = "u" }
states = { q = 0.0, v = 0.0 }
parameters = { gain = 300.0, viscous = 8.0 }
rates = { q = "v", v = "gain*u - viscous*v" }
outputs = { q = "q", v = "v" }
"""
FORCE = Added("constant_disturbance", "drive.v'", {"level": 0.01})
SPRING = Added("cubic_stiffness", "drive.v'", {"coefficient": 0.15})


def _log(noise: float) -> Record:
    """20 s of the loop with the spring, which the controller holds back."""
    bench = with_added(build(parse_design(SERVO)), (SPRING,))
    run = simulate(bench, {"demand": Sine(amplitude=9.0, frequency=0.7)}, duration=20.0).record
    draw = np.random.default_rng(5)
    noisy = {name: run[name] + noise * draw.standard_normal(len(run)) for name in ("q", "v")}
    return Record(run.time, {"demand": run["demand"], "u": run["u"], **noisy}, held=frozenset({"u"}))


def test_a_spring_that_drives_away_is_found_along_the_measured_motion() -> None:
    answer = diagnose(parse_design(SERVO), [_log(0.1)], effort=Effort(processes=1, signals=("q", "v")))
    (one,) = answer.missing
    coefficient = one.parameters["coefficient"]
    assert (one.effect, one.at, one.certain, answer.verdict) == ("cubic_stiffness", "drive.v'", True, "missing")
    assert abs(coefficient.value - 0.15) < 3 * coefficient.std
    assert any("along the measured motion" in note for note in answer.notes)
    for signal in ("q", "v"):
        low, high = answer.ladder_bands[-1][signal]
        assert low < 1.0 < high


def test_noise_of_the_measured_motion_is_no_constant_force() -> None:
    """An integrating drive adds up what noise does to the spring's force: as much as a constant one would be."""
    log = _log(0.1)
    part = segments(build(parse_design(SERVO)), set(log.names))[-1]
    case = prepared_case(part, (log,), (), frozenset())
    along = replace(SPRING, along={"q": "q"})
    seen, one = _seen(case, (along,))
    plain = fit_hypothesis(seen, (along, FORCE), near=one).by_path["effects.1001.level"]
    assert abs(plain.value) < 3 * plain.std
    without = replace(seen, nuisance=())
    trusted = fit_hypothesis(without, (along, FORCE)).by_path["effects.1001.level"]
    assert trusted.std < 0.2 * plain.std and abs(trusted.value) > 10 * trusted.std


def test_a_motion_without_its_noise_is_no_worse_at_its_ends() -> None:
    time = np.arange(20_000) * 1e-3
    true = 5.0 * np.sin(time) + 3.0 * time / 20  # begins and ends at different values
    noisy = true + 0.1 * np.random.default_rng(2).standard_normal(len(time))
    error = wiener_part(noisy, 0.1) - true
    assert error.std() < 0.02 and np.abs(error[[0, -1]]).max() < 0.1


def _seen(case: Case, added: tuple[Added, ...]) -> tuple[Case, Fitted]:
    """The case through the noise that the hypothesis leaves, with its nuisance, and its fit."""
    carried = Carried({})
    case = case.whitened_by(noise_of(case, nominal(case), carried))
    first = fit_hypothesis(case, added)
    case = with_nuisance_of(case.whitened_by(noise_of(case, first, carried)), first)
    return case, fit_hypothesis(case, added)
