"""The chapters of the report that hold the model against logs."""

from pathlib import Path

import numpy as np
import pytest

from delaytools.design.design import parse_design
from delaytools.diagnosis.answer import NextExperiment, Unexplained
from delaytools.measurement.compare import compare
from delaytools.report.contents import gather
from delaytools.report.evidence import Evidence
from delaytools.report.figure_ladder import helped
from delaytools.report.figure_measured import draw_measured
from delaytools.report.figure_strips import draw_strips
from delaytools.report.page import Section
from delaytools.report.pages import page_of
from delaytools.report.write import write_report
from delaytools.signals.record import Record
from tests.diagnosis.found import DEAD_BAND, DELAY, OPEN, SLOWER, diagnosis
from tests.measurement.bench_logs import bench_design, bench_log
from tests.report.conftest import SERVO
from tests.report.test_report_files import check, outside

BAND = {"type": "dead_band", "at": "actuator.input", "half_width": "0.1 deg"}


@pytest.fixture(scope="module")
def record() -> Record:
    return bench_log(BAND)


def sections(evidence: Evidence | None) -> dict[str, Section]:
    return {section.key: section for section in page_of(gather(bench_design(), lambda _: None, (), evidence)).sections}


def everything(section: Section) -> str:
    cells = [cell for table in section.tables for row in table.rows for cell in (*row, table.caption)]
    return " ".join([section.lead, *section.paragraphs, *cells, *section.missing])


def test_without_logs_the_report_says_so() -> None:
    found = sections(None)
    assert "measured" not in found and "missing" not in found
    assert any("No log was given" in limit for limit in found["limits"].missing)


def test_with_logs_the_limits_say_something_else(record: Record) -> None:
    found = sections(Evidence(("run.csv",), compare(bench_design(), [record])))
    limits = " ".join(found["limits"].missing)
    assert "No log was given" not in limits and "No missing effect was searched for" in limits
    assert "nothing is compared" not in limits


def test_the_chapter_of_the_comparison(record: Record) -> None:
    found = sections(Evidence(("run.csv",), compare(bench_design(), [record]), diagnosis(DEAD_BAND)))["measured"]
    assert "the model fails at fin" in found.lead
    assert [figure.name for figure in found.figures] == [
        "measured_fin", "measured_command", "measured_rate", "measured_sensed", "error_strips",
    ]  # fmt: skip
    rows = {row[0]: row for row in found.tables[0].rows}
    assert rows["fin"][-1] == "FAILS" and rows["sensed"][-1] == "adequate" and rows["fin"][1] == "deg"


def test_the_chapter_of_what_is_missing(record: Record) -> None:
    full = diagnosis(DEAD_BAND, DELAY, verdict="unexplained", notes=("a log note",), **OPEN)
    text = everything(sections(Evidence(("run.csv",), compare(bench_design(), [record]), full))["missing"])
    for part in (
        "The model lacks dead_band at actuator.input", "Perhaps it lacks delay at gyro.input",
        "No known effect explains all of rate", "half_width 0.1003 ± 0.00071 deg", "lag@gyro.input",
        "do not tell apart", "Next experiment: a higher frequency", "v·|v|", "Small commands have no effect",
        "Linear margins do not see dead_band@actuator.input", "a log note",
    ):  # fmt: skip
        assert part in text, part


def test_a_search_cut_short_does_not_say_that_nothing_explains_it(record: Record) -> None:
    left = Unexplained("rate", 0.1, ((8.0, 16.0), (1.0, 2.0), (2.0, 4.0)), "")
    found = diagnosis(verdict="unexplained", unexplained=(left,), budget_exhausted=True)
    text = everything(sections(Evidence(("run.csv",), compare(bench_design(), [record]), found))["missing"])
    assert "The search was over before all of rate was explained." in text and "No known effect" not in text
    assert "(1 to 4 Hz and 8 to 16 Hz)" in text


def test_a_next_experiment_without_an_input_names_none(record: Record) -> None:
    asked = NextExperiment("measure the actuator alone", {}, 0.0)
    found = diagnosis(DELAY, verdict="missing", next_experiment=asked)
    text = everything(sections(Evidence(("run.csv",), compare(bench_design(), [record]), found))["missing"])
    assert "Next experiment: measure the actuator alone." in text and "Input:" not in text


def test_margins_before_and_after(record: Record) -> None:
    evidence = Evidence(("run.csv",), compare(bench_design(), [record]), diagnosis(SLOWER))
    item = gather(bench_design(), lambda _: None, (), evidence).improvement
    assert item is not None and item.after.gain_margin is not None and item.before.gain_margin is not None
    assert item.after.gain_margin < 0.98 * item.before.gain_margin
    assert "as designed it has" in everything(sections(evidence)["missing"])


def test_nothing_missing_is_said(record: Record) -> None:
    found = sections(Evidence(("run.csv",), compare(bench_design(), [bench_log()]), diagnosis()))
    assert "Nothing is missing" in found["missing"].lead and "explains 4 measured signals" in found["measured"].lead
    assert found["missing"].figures == ()


def test_the_ladder_shows_what_changes() -> None:
    assert helped(diagnosis(DEAD_BAND).ladder) == ("fin",)
    assert helped(diagnosis(DEAD_BAND, DELAY).ladder) == ("fin", "sensed")


def test_figures_carry_labels_with_units(record: Record) -> None:
    found = compare(bench_design(), [record])
    figure = draw_measured(found["fin"], "words")
    labels = [axes.get_ylabel() for axes in figure.axes] + [axes.get_xlabel() for axes in figure.axes]
    assert "fin (deg)" in labels and "Time (s)" in labels and "Measured −\nmodel (deg)" in labels
    close = figure.axes[1].get_xlim()
    assert close[1] - close[0] == pytest.approx(0.5, abs=0.05)
    strips = draw_strips(found.signals, "words")
    assert len(strips.axes) == 4 * 4 + 1


def test_dead_signals_can_be_drawn(record: Record) -> None:
    still = dict.fromkeys(record.names, np.zeros(len(record)))
    found = compare(bench_design(), [Record(record.time, still, record.units, record.held, "still.csv")])
    draw_strips(found.signals, "words")
    draw_measured(found["fin"], "words")


def test_the_files_of_a_report_with_logs(record: Record, tmp_path: Path) -> None:
    evidence = Evidence(("run.csv",), compare(bench_design(), [record]), diagnosis(DEAD_BAND))
    files = write_report(bench_design(), tmp_path, evidence=evidence)
    names = {Path(path).stem for path in files.figures}
    assert {"measured_fin", "error_strips", "ladder"} <= names
    text = check(files, names)
    assert "Model against measurement" in text and "What is missing" in text and outside(text) == []


def test_a_design_whose_blocks_were_not_measured(tmp_path: Path) -> None:
    design = parse_design(SERVO, "servo.toml")
    t = np.arange(500) * 1e-3
    record = Record(t, {"angle": np.sin(t)}, {"angle": "deg"}, frozenset(), "run.csv")
    found = compare(design, [record])
    page = page_of(gather(design, lambda _: None, (), Evidence(("run.csv",), found)))
    measured = next(section for section in page.sections if section.key == "measured")
    assert "No measured signal could be compared" in measured.lead and "demand" in measured.missing[0]
