"""The numbers of a report are the answers of the API, and its sums add up."""

import math

import numpy as np
import pytest

from delaytools.analysis.opened_loop import open_loop
from delaytools.analysis.questions import loop_margins
from delaytools.design.build import build, flight
from delaytools.design.design import Design, parse_design
from delaytools.report.assumptions import remarks
from delaytools.report.budget import budget
from delaytools.report.cases import AS_WRITTEN, cases
from delaytools.report.contents import Contents
from delaytools.report.pages import page_of
from delaytools.report.words import degrees, milliseconds
from tests.report.conftest import SERVO


def test_the_table_of_margins_is_the_answer_of_loop_margins(servo: Design, contents: Contents) -> None:
    table = page_of(contents).sections[0].tables[0]
    rows = {row[0]: row for row in table.rows if row[0].strip() != "in flight"}
    for name in (AS_WRITTEN, "slow", "compensated"):
        loop = build(servo, None if name == AS_WRITTEN else name)
        m = loop_margins(loop, "rate").margins[0]
        assert rows[name][2] == f"{m.gain_margin:.3f}"
        assert rows[name][4] == degrees(m.phase_margin)
        assert rows[name][6] == milliseconds(m.delay_margin)
    assert rows["lost"][1] == "NO" and rows["lost"][2] == "unstable"


def test_flight_and_the_judgement_of_the_bench(servo: Design, contents: Contents) -> None:
    assert contents.verdict is not None
    slow = contents.verdict["slow"]
    flies = loop_margins(flight(servo, "slow"), "rate").margins[0]
    assert slow.flight == flies
    assert slow.judgement == "pessimistic"
    assert contents.verdict["lost"].judgement == "unstable"
    bench, truth = contents.verdict["compensated"].bench, contents.verdict["compensated"].flight
    assert truth is not None
    more = bench.delay_margin > truth.delay_margin or bench.modulus_margin > truth.modulus_margin  # type: ignore[operator]
    assert (contents.verdict["compensated"].judgement == "optimistic") == more


def test_the_sweep_passes_through_the_margins_as_they_stand(contents: Contents) -> None:
    curve = next(c for c in contents.curves if "slow" in dict(c.family.members))
    assert dict(curve.family.members) == pytest.approx({AS_WRITTEN: 0.02, "slow": 0.06, "lost": 0.3})
    assert contents.verdict is not None
    for name in (AS_WRITTEN, "slow"):
        place = int(np.argmin(np.abs(curve.delays - dict(curve.family.members)[name])))
        m = contents.verdict[name].bench
        assert curve.gain_margin[place] == pytest.approx(m.gain_margin)
        assert curve.phase_margin[place] == pytest.approx(m.phase_margin)
    edge = curve.stable[0][1]
    slow = contents.verdict["slow"].bench
    assert edge == pytest.approx(0.06 + slow.delay_margin, rel=1e-6)  # type: ignore[operator]


def test_the_locus_crosses_where_stability_ends(contents: Contents) -> None:
    item = contents.loci[0]
    curve = next(c for c in contents.curves if c.family.name == item.name)
    tau, omega = item.crossings[0].value, item.crossings[0].frequency
    assert tau == pytest.approx(curve.stable[0][1])
    loop = open_loop(curve.family.loop, "rate", "table.input").transfer(tau)
    assert abs(1 + complex(loop.siso(1j * omega))) < 1e-6


def test_the_budget_of_a_series_loop_adds_up(contents: Contents) -> None:
    item = next(b for b in contents.budgets if b.name == "slow")
    by_name = {entry.name: entry for entry in item.entries}
    assert by_name["table"].delay == pytest.approx(0.06, rel=1e-6)
    assert by_name["sensor"].delay == pytest.approx(2 * 0.7 / 200, rel=1e-4)
    assert by_name["axis"].delay is None and by_name["axis"].phase == pytest.approx(-math.pi / 2)
    assert by_name["table"].bench and not by_name["sensor"].bench
    assert item.total == pytest.approx(0.06 + 1.4 / 200, rel=1e-4)
    assert item.loop_phase == pytest.approx(item.series_phase, abs=1e-6)
    assert by_name["table"].phase == pytest.approx(-0.06 * item.crossover)  # type: ignore[operator]


def test_a_hold_is_charged_once_where_two_blocks_sample_together() -> None:
    text = SERVO.replace('type = "gain"\n', 'type = "sample_hold"\nperiod = "8 ms"\n').replace(
        '"late_angle + lead*rate"', '"sampled"'
    )
    text += '[blocks.sampler]\ntype = "sample_hold"\ninput = "seen_late"\noutput = "taken"\nperiod = "8 ms"\n'
    text = text.replace('"sampled"', '"late_angle"').replace('output = "seen"', 'output = "seen_late"')
    text = text.replace("demand - seen", "demand - taken")
    from_text = parse_design(text)
    case = cases(from_text)[0]
    found = budget(case, "rate", loop_margins(case.loop, "rate").margins[0], frozenset())
    holds = {entry.name: entry.delay for entry in found.entries if entry.kind == "sample hold"}
    assert holds == pytest.approx({"sampler": 0.0, "controller": 0.004}, abs=1e-12)


def test_runs_say_which_grows(contents: Contents) -> None:
    assert contents.runs is not None
    assert {run.name: run.grows for run in contents.runs.runs}["lost"]
    assert not {run.name: run.grows for run in contents.runs.runs}["slow"]
    assert contents.runs.demand == ("demand", "seen")


def test_compensations_are_found_and_compared(contents: Contents) -> None:
    (item,) = contents.compensations
    assert (item.name, item.before_name) == ("compensated", "slow")
    assert item.changed == (("parameters.lead", "0.0", "0.03"),)


def test_remarks_have_their_place(servo: Design) -> None:
    found = {item.place: item for item in remarks(servo)}
    assert found["parameters.k"].assumed and found["parameters.k"].value == "12.0"
    assert not found["blocks.table.delay"].assumed
    assert len(found) == 2
