"""The chapter on limit cycles: lines followed over the delay, configurations checked, words that say which is which."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from delaytools.analysis.limit_cycles import LimitCycle
from delaytools.design.design import parse_design
from delaytools.report.cases import asked, cases
from delaytools.report.contents import Contents, Trouble, gather
from delaytools.report.cycles import CycleCurve, _lines, cycle_curve
from delaytools.report.delay_curves import delay_curve, families
from delaytools.report.figure_cycles import draw_cycles
from delaytools.report.sections_cycles import cycles_section
from tests.report.conftest import REST, SERVO

SPAN = (0.0, 0.3)
PIECES = {"limit": 'type = "saturation"\nlimit = "40 deg/s"', "band": 'type = "dead_band"\nhalf_width = "3 deg/s"'}


def curve_of(piece: str) -> CycleCurve:
    effect = f'\n[[effects]]\nat = "axis.input"\n{PIECES[piece]}\n' if piece else ""
    design = parse_design(SERVO + effect + REST, "servo.toml")
    questions = asked(design)
    family = next(f for f in families(cases(design), questions) if "lost" in dict(f.members))
    return cycle_curve(delay_curve(family, questions, SPAN, points=5), questions, SPAN)


@pytest.mark.parametrize("piece", PIECES)
def test_cycles_begin_where_the_linear_loop_is_lost(piece: str) -> None:
    curve = curve_of(piece)
    (lost,) = curve.lost
    (line,) = curve.lines
    assert line.lasts == (piece == "limit")
    step = np.diff(np.linspace(*SPAN, 25))[0]
    assert lost < line.delays[0] < lost + step and line.delays[-1] == SPAN[1]
    assert np.all(np.diff(line.frequencies) < 0)
    growing = np.diff(line.amplitudes) > 0  # a limit holds more the more is lost, a band is left by less
    assert growing.all() if piece == "limit" else not growing.any()


def test_configurations_as_they_stand_are_checked_by_runs() -> None:
    found = {name: answer.cycles for name, _, answer in curve_of("limit").present}
    assert found["slow"] == ()
    (one,) = found["lost"]
    assert one.stable and one.check is not None and one.check.agrees
    line = curve_of("limit").lines[0]
    assert line.amplitudes[-1] == pytest.approx(one.amplitude) and line.frequencies[-1] == pytest.approx(one.frequency)


def test_a_loop_that_nothing_bends_has_no_lines(contents: Contents) -> None:
    assert all(curve.nonlinear == () and curve.lines == () for curve in contents.cycles)
    section = cycles_section(contents)
    assert "Nothing in any loop depends on amplitude" in section.lead and section.figures == ()


def test_a_search_that_failed_does_not_say_that_there_is_none(contents: Contents) -> None:
    failed = replace(contents, cycles=(), troubles=(*contents.troubles, Trouble("cycles", "no room")))
    section = cycles_section(failed)
    assert section.lead == "Limit cycles could not be sought." and section.missing == ("no room",)


@pytest.mark.parametrize("piece", PIECES)
def test_the_chapter_says_what_lasts_and_what_grows(piece: str) -> None:
    effect = f'\n[[effects]]\nat = "axis.input"\n{PIECES[piece]}\n'
    section = cycles_section(gather(parse_design(SERVO + effect + REST, "servo.toml"), lambda _: None))
    (row,) = section.tables[0].rows
    assert row[0] == "lost" and row[4] == ("lasts" if piece == "limit" else "parts")
    words = "lost oscillates, rate by ±" if piece == "limit" else "In lost a swing of rate dies out below ±"
    assert words in section.lead and row[2] in section.lead
    assert [figure.name for figure in section.figures] == ["cycles"]


def cycle(delay: float, amplitude: float, frequency: float, stable: bool) -> LimitCycle:
    return LimitCycle(delay, amplitude, frequency, stable, -1.0, 0.0, {}, (), None, None)


def test_cycles_are_joined_to_the_nearest_and_never_over_a_gap() -> None:
    delays = [0.0, 1.0, 2.0, 3.0]
    lasting = [cycle(tau, 1.0 + 0.1 * tau, 5.0, True) for tau in (0.0, 1.0, 3.0)]
    slow = [cycle(tau, 1.0 + 0.1 * tau, 5.0 - 0.9 * math.log1p(tau), True) for tau in delays]
    parting = [cycle(tau, 0.9, 5.0, False) for tau in delays]
    found = list(_lines((*lasting, *slow, *parting), delays))
    assert sorted((len(line.delays), line.lasts) for line in found) == [(1, True), (2, True), (4, False), (4, True)]


def test_cycles_that_another_motion_leaves_part_nothing() -> None:
    """A relay's faster cycles: from below and from above the loop goes to the slow one."""
    relay = SERVO.replace('type = "gain"\ninput', 'type = "relay"\nlevel = 1.0\ninput')
    section = cycles_section(gather(parse_design(relay + REST, "servo.toml"), lambda _: None))
    kinds = {row[4] for row in section.tables[0].rows}
    assert kinds == {"lasts", "neither"} and "dies out" not in section.lead
    assert "oscillates, rate by ±" in section.lead


def test_lines_that_last_are_full_and_the_others_dashed() -> None:
    curves = (curve_of("limit"), curve_of("band"))
    figure = draw_cycles(curves, "Amplitude", "table.input", {name: "#0072B2" for name, _, _ in curves[0].present}, "")
    assert isinstance(figure, Figure)
    styles = [line.get_linestyle() for line in figure.axes[0].lines if line.get_marker() == "."]
    assert styles == ["-", "--"]
    ended = [line for line in figure.axes[0].lines if line.get_marker() == "x"]
    assert len(ended) == 1
