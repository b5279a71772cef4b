"""Effects that hide: behind noise, between ticks, behind a tolerance, in each other, where the signal rests."""

import numpy as np
import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.design.edit import with_effect
from delaytools.diagnosis.answer import Diagnosis
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.signals.expression import Expression
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Formula, Multisine, Stimulus
from delaytools.simulation.simulate import simulate
from tests.diagnosis.test_every_effect_is_found import GUST, MOVES, SERVO

CARRIAGE = """
frame = "1 ms"
[signals]
r = "V"
u = "V"
x = "deg"
v = "deg/s"
[blocks.computer]
type = "sample_hold"
input = "r"
output = "u"
period = "2 ms"
[blocks.drive]
type = "equations"
inputs = { u = "u" }
states = { q = 0.0, w = 0.0 }
parameters = { gain = 335.0, viscous = 7.5 }
rates = { q = "w", w = "gain*u - viscous*w" }
outputs = { x = "q", v = "w" }
[tolerance]
"drive.gain" = "5 %"
"""
PUSH = Multisine(amplitude=1.5, from_frequency=0.4, to_frequency=6.0, lines=24)


def found(
    text: str, effects: tuple[dict, ...], driven: dict[str, Stimulus], noise: dict[str, float], *, step: float = 0.0
) -> Diagnosis:
    """The diagnosis of a bench with these effects in it; step: of a lattice on which x is logged, noise included."""
    design, true = parse_design(text), parse_design(text.replace("335.0", "340.0"))
    for table in effects:
        true = with_effect(true, table)
    run = simulate(build(true), driven, duration=6.0, seed=4).record
    generator = np.random.default_rng(11)
    columns = {n: run[n] + noise.get(n, 0.0) * generator.standard_normal(len(run)) for n in run.names}
    columns |= {name: stimulus.value(run.time) for name, stimulus in driven.items()}
    if step:
        columns["x"] = step * np.round(columns["x"] / step)
    log = Record(run.time, columns, {n: str(one) for n, one in design.tables.signals.items()})
    return diagnose(design, [log], effort=Effort(processes=1))


def named(answer: Diagnosis) -> dict[str, dict[str, float]]:
    """The values of what is missing, by kind."""
    return {one.effect: {n: q.value for n, q in one.parameters.items()} for one in answer.missing}


def test_a_quantiser_in_front_of_an_integrating_drive_whose_gain_is_not_known() -> None:
    table = {"type": "quantization", "at": "drive.u", "step": 0.13}
    answer = found(CARRIAGE, (table,), {"r": PUSH}, {"x": 0.01, "v": 0.1})
    assert answer.verdict == "missing" and list(named(answer)) == ["quantization"]
    assert named(answer)["quantization"]["step"] == pytest.approx(0.13, rel=1e-5)


def test_a_quantiser_behind_noise_is_shown_by_the_lattice() -> None:
    answer = found(SERVO, (), {"demand": MOVES, "gust": GUST}, {"x": 0.01}, step=0.018)
    assert list(named(answer)) == ["quantization"] and answer.missing[0].at == "actuator.output"
    assert named(answer)["quantization"]["step"] == pytest.approx(0.018, rel=1e-6)


def test_a_lattice_far_below_the_noise_is_how_logs_are_written() -> None:
    answer = found(SERVO, (), {"demand": MOVES, "gust": GUST}, {"x": 0.01}, step=0.001)
    assert answer.verdict == "adequate" and not answer.missing


def test_a_quantiser_that_the_design_has_is_not_named_again() -> None:
    table = {"type": "quantization", "at": "actuator.output", "step": 0.2}
    text = with_effect(parse_design(SERVO), table).text
    answer = found(text, (), {"demand": MOVES, "gust": GUST}, {})
    assert answer.verdict == "adequate" and not answer.missing


def test_two_forces_that_look_like_another_damping() -> None:
    tables = (
        {"type": "quadratic_drag", "at": "actuator.rate'", "coefficient": 0.7},
        {"type": "cubic_damping", "at": "actuator.rate'", "coefficient": -0.004},
    )
    answer = found(SERVO, tables, {"demand": MOVES, "gust": GUST}, {"x": 0.003})
    assert set(named(answer)) == {"quadratic_drag", "cubic_damping"}
    assert named(answer)["quadratic_drag"]["coefficient"] == pytest.approx(0.7, rel=0.05)
    assert named(answer)["cubic_damping"]["coefficient"] == pytest.approx(-0.004, rel=0.05)


def test_a_coupling_into_a_computer_slower_than_the_rows() -> None:
    table = {"type": "cross_coupling", "at": "controller.input", "gain": 0.01, "source": "gust"}
    answer = found(SERVO, (table,), {"demand": MOVES, "gust": GUST}, {"x": 0.01})
    assert list(named(answer)) == ["cross_coupling"] and answer.missing[0].signal == "command"
    assert named(answer)["cross_coupling"]["gain"] == pytest.approx(0.01, rel=0.01)


def test_an_edge_where_the_signal_rests_lies_in_the_middle_and_says_how_sure_it_is() -> None:
    """Nothing moves from 3 s to 3.4 s: the gain may have come back at any time in between."""
    rests = Formula(formula=Expression("3*sin(2*pi*1.25*t)*(0.5 + 0.5*sign(abs(t - 3.2) - 0.2))"))
    table = {"type": "transient_gain", "at": "actuator.output", "factor": 1.3, "start": 1.5, "end": 3.3}
    answer = found(SERVO, (table,), {"demand": rests, "gust": GUST}, {"x": 0.01})
    end = answer.missing[0].parameters["end"]
    assert [one.effect for one in answer.missing] == ["transient_gain"]
    assert abs(end.value - 3.3) < 3 * end.std and 0.01 < end.std < 0.2
    assert answer.missing[0].parameters["start"].value == pytest.approx(1.5, abs=0.01)
