"""A diagnosis put into a design, and taken out again."""

import math

import pytest

from delaytools.analysis.questions import loop_margins
from delaytools.design.build import build
from delaytools.design.edit import with_value, without_effect
from delaytools.diagnosis.answer import Missing, Quantity
from delaytools.diagnosis.improve import additions, improved, rounded, written
from delaytools.loop.values import resolve, value_paths
from delaytools.measurement.compare import compare
from delaytools.signals.trouble import AnalysisError
from tests.diagnosis.found import DEAD_BAND, DELAY, SLOWER, diagnosis
from tests.measurement.bench_logs import BENCH, bench_design, bench_log

ORIGIN = {"logs": ("run.csv",), "date": "2026-01-31"}


def test_a_certain_effect_becomes_an_entry_with_its_origin() -> None:
    new = improved(bench_design(), diagnosis(DEAD_BAND), **ORIGIN)
    tail = new.text[len(BENCH.rstrip()) :]
    assert tail == (
        "\n\n# fitted to run.csv on 2026-01-31: half_width 0.10034 ± 0.00071 deg\n"
        "# held-out error of fin: 0.1 rms without it, 0.0101 with it\n"
        '[[effects]]\ntype = "dead_band"\nat = "actuator.input"\nhalf_width = "0.10034 deg"\n'
    )
    assert value_paths(build(new))["effects.0.half_width"] == pytest.approx(0.10034)


@pytest.mark.parametrize(
    "text", [BENCH, BENCH.rstrip(), BENCH.replace("\n", "\r\n")], ids=["lines", "no end", "CRLF"]
)
def test_taking_the_effect_out_gives_the_old_bytes(text: str) -> None:
    design = bench_design(text)
    new = improved(design, diagnosis(DEAD_BAND), **ORIGIN)
    assert without_effect(new, 0).text == design.text


def test_two_effects_go_out_one_by_one() -> None:
    sure = Missing(DELAY.effect, DELAY.at, DELAY.signal, DELAY.parameters)
    new = improved(bench_design(), diagnosis(DEAD_BAND, sure), **ORIGIN)
    assert [one["type"] for one in new.data["effects"]] == ["dead_band", "delay"]
    assert new.data["effects"][1]["delay"] == "7.012 ms"
    assert without_effect(without_effect(new, 1), 0).text == BENCH


def test_what_is_not_certain_is_added_only_when_asked_for() -> None:
    found = diagnosis(DEAD_BAND, DELAY)
    assert [a.missing.effect for a in additions(bench_design(), found, **ORIGIN)] == ["dead_band"]
    new = improved(bench_design(), found, **ORIGIN, effect="delay@gyro.input")
    assert [one["type"] for one in new.data["effects"]] == ["delay"] and "not certain" in new.text
    rival = improved(bench_design(), found, **ORIGIN, effect="lag@gyro.input")
    assert rival.data["effects"][0]["time_constant"] == "6.9 ms"
    with pytest.raises(AnalysisError, match=r"did not fit.*nearest: delay@gyro.input"):
        improved(bench_design(), found, **ORIGIN, effect="delay@gyro.inptu")


def test_a_changed_value_keeps_its_unit_and_its_remark() -> None:
    new = improved(bench_design(), diagnosis(SLOWER), **ORIGIN)
    assert 'natural_frequency = "81.23 rad/s"   # data sheet' in new.text and "effects" not in new.data
    assert "# fitted to run.csv on 2026-01-31: natural_frequency 81.23 ± 0.31 rad/s\n" in new.text
    back = with_value(new, "actuator.natural_frequency", "90 rad/s")
    assert (
        "".join(line for line in back.text.splitlines(True) if not line.startswith(("# fitted", "# held")))
        == BENCH
    )
    hertz = bench_design(BENCH.replace('"90 rad/s"', '"14.3 Hz"'))
    found = improved(hertz, diagnosis(SLOWER), **ORIGIN).data["blocks"]["actuator"]["natural_frequency"]
    assert found == f"{round(81.234 / (2 * math.pi), 3):g} Hz"


def test_a_value_that_a_formula_or_a_configuration_gives_becomes_an_effect() -> None:
    formula = bench_design(BENCH.replace('"90 rad/s"', '"3*w"') + "\n[parameters]\nw = 30.0\n")
    named = bench_design(
        BENCH + '\n[configurations.soft]\nset = { "actuator.natural_frequency" = "70 rad/s" }\n'
    )
    for design, configuration in ((formula, None), (named, "soft")):
        new = improved(design, diagnosis(SLOWER), **ORIGIN, configuration=configuration)
        assert new.data["effects"][0]["type"] == "parameter_change:natural_frequency"
        assert value_paths(build(new, configuration))["effects.0.natural_frequency"] == pytest.approx(81.23)
        assert without_effect(new, 0).text == design.text
    assert "configuration soft" in new.text and "every one has it" in new.text


def test_a_value_that_an_effect_of_the_design_changes_gets_an_effect_behind_it() -> None:
    first = 'type = "parameter_change:natural_frequency"\nat = "actuator"\nnatural_frequency = "85 rad/s"\n'
    new = improved(bench_design(f"{BENCH}\n[[effects]]\n{first}"), diagnosis(SLOWER), **ORIGIN)
    built = build(new)
    assert len(new.data["effects"]) == 2
    assert resolve(built)["actuator"].block.natural_frequency == pytest.approx(81.23)


def test_tolerated_values_are_set_only_when_asked_for() -> None:
    found = diagnosis(tolerated={"actuator.damping": Quantity(0.6234, 0.0042)})
    assert improved(bench_design(), found, **ORIGIN).text == BENCH
    new = improved(bench_design(), found, **ORIGIN, values=True)
    assert new.data["blocks"]["actuator"]["damping"] == 0.6234 and "inside its tolerance" in new.text


def test_sources_and_smoothing_widths_are_written() -> None:
    mode = Missing(
        "cross_coupling", "gyro.output", "sensed", {"gain": Quantity(0.2, 0.001, "")}, {"source": "fin"}
    )
    new = improved(bench_design(), diagnosis(mode), **ORIGIN)
    assert new.data["effects"][0]["source"] == "fin"
    build(new)


def test_numbers_end_where_their_standard_error_does() -> None:
    assert rounded(0.0151234, 0.00021) == 0.01512
    assert rounded(2512.7, 33.0) == 2513.0
    assert rounded(0.5, 3.0) == 0.5 and rounded(1 / 3, math.nan) == 0.333333 and rounded(0.0, 1.0) == 0.0
    assert written(Quantity(0.0151234, 0.00021, "s")) == "15.12 ms"
    assert written(Quantity(-1.5, 0.1, "")) == -1.5
    assert written(Quantity(3.0, 0.1, "no unit")) == 3.0


def test_the_improved_bench_meets_the_log() -> None:
    record = bench_log({"type": "dead_band", "at": "actuator.input", "half_width": "0.1 deg"})
    design = bench_design()
    assert not compare(design, [record]).adequate
    new = improved(design, diagnosis(DEAD_BAND), **ORIGIN)
    assert compare(new, [record]).adequate
    assert loop_margins(build(new), "command").margins[0].stable
