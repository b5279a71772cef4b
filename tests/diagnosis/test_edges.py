"""Where the edges of a window of gain lie, and how sure that is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.edges import _gains, edge_near
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.forward import _windows_again
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.proposals import sharpened_again
from delaytools.diagnosis.screen import Base, base_of, response
from delaytools.diagnosis.segment_report import _where_windows_do_the_same
from delaytools.diagnosis.windows import _forgets, transients, with_edges_fitted
from delaytools.loop.port import find_port
from delaytools.signals.parameter import Parameter
from delaytools.signals.stimulus import Multisine, Sine
from tests.diagnosis.small_cases import ACTUATOR, NOISE, SLIDE, fitted, planted

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)
SEEDS = 10


COMPUTER = """
[blocks.computer]
type = "sample_hold"
input = "u"
output = "d"
period = "4 ms"
"""


def window(port: str, factor: float) -> Added:
    values = {"factor": factor, "start": 2.0, "end": 3.5}
    return Added("transient_gain", port, values, {}, frozenset({"start", "end"}))


PLANTED = (window("act.output", 1.02),)


def with_noise(clean: Case, seed: int, *, slow: float = 0.0) -> Base:
    """The case with noise of a seed; slow: its correlation from row to row, which lets a jump show by itself."""
    rows = np.random.default_rng(seed).standard_normal(clean.measured[0].shape)
    noise = NOISE * np.sqrt(1 - slow**2) * lfilter([1.0], [1.0, -slow], rows, axis=0)
    case = replace(clean, measured=(clean.measured[0] + noise,), _replays={})
    known = Fitted(PLANTED, case.parameters(PLANTED), np.zeros(0), np.zeros((0, 3)))
    case = case.whitened_by(noise_of(case, known, Carried({})))
    return base_of(case, fitted(case))


@pytest.mark.parametrize("port", ["act.input", "act.output", "computer.input"])
@pytest.mark.parametrize("side", [0, 1])
def test_what_a_row_is_worth_is_what_a_run_says(port: str, side: int) -> None:
    free = (Parameter("act.damping", 0.6, low=0.3, high=0.9),)
    text = ACTUATOR.replace('input = "u"', 'input = "d"') + COMPUTER if port.startswith("computer") else ACTUATOR
    base = with_noise(replace(planted(text, (window(port, 1.1),), WAVE), tolerated=free), 1)
    way, shifts = base.way(port), np.arange(-400, 401)
    change = response(base, window(port, 1.02).moved({"start": 1.9995, "end": 3.4995}))
    assert way is not None and change is not None and base.basis.shape[1] == 1
    found = _gains(base, way, (base.projected(change), 2 * side - 1), ((2000, 3500)[side], shifts))
    for place in (0, 250, 399, 401, 600, 800):
        name, row = ("start", "end")[side], (2000, 3500)[side] + shifts[place]
        moved = response(base, window(port, 1.02).moved({"start": 1.9995, "end": 3.4995} | {name: (row - 0.5) * 1e-3}))
        assert moved is not None and found[place] == pytest.approx(base.gain(moved)[0], rel=1e-4)


def test_edges_of_a_weak_window_are_as_sure_as_is_said() -> None:
    clean, off = planted(ACTUATOR, PLANTED, WAVE, noise=1e-9), []
    for seed in range(SEEDS):
        base = with_noise(clean, seed)
        (coarse,) = (s.added for s in transients(base, spots(clean.segment)) if s.added.at == "act.output")
        one = with_edges_fitted(base, coarse).added
        off += [(one.values[name] - true) / one.errors[name] for name, true in (("start", 2.0), ("end", 3.5))]
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.4


def test_a_row_where_the_jump_itself_shows_is_found_from_afar() -> None:
    """Between it and where a search begins lie hills that are nearly as high."""
    base = with_noise(planted(ACTUATOR, PLANTED, WAVE, noise=1e-9), 1, slow=0.95)
    found = with_edges_fitted(base, PLANTED[0].moved({"start": 2.3, "end": 3.1})).added
    for name, true in (("start", 2.0), ("end", 3.5)):
        assert found.values[name] == pytest.approx(true, abs=2e-3) and found.errors[name] < 2e-3


def test_a_window_may_last_to_the_end_of_the_log() -> None:
    last = Added("transient_gain", "act.output", {"factor": 1.2, "start": 4.0, "end": 7.0})
    base = with_noise(planted(ACTUATOR, (last,), WAVE, noise=1e-9), 1)
    found = with_edges_fitted(base, last.moved({"start": 4.1, "end": 5.9})).added
    assert found.values["start"] == pytest.approx(4.0, abs=2e-3)
    assert found.values["end"] > 5.999


def test_a_window_that_begins_with_the_first_row_has_an_end() -> None:
    base = with_noise(planted(ACTUATOR, (window("act.output", 1.1).moved({"start": 0.0}),), WAVE, noise=1e-9), 1)
    way, one = base.way("act.output"), window("act.output", 1.1).moved({"start": 0.0})
    assert way is not None and edge_near(base, way, one, 0) is not None
    end = edge_near(base, way, one, 1)
    assert end is not None and end[0] == pytest.approx(3.5, abs=0.1)


def test_a_window_whose_answer_stays_is_screened_and_its_edges_found_beside_the_fit() -> None:
    slow = Multisine(amplitude=3.0, from_frequency=0.2, to_frequency=1.0, lines=9)
    true = window("drive.u", 0.6)
    case = planted(SLIDE, (true,), slow)
    base = base_of(case, fitted(case))
    (found,) = [one for one in transients(base, spots(case.segment)) if one.added.at == "drive.u"]
    assert found.gain > 0.9 * fitted(case).chi2
    assert found.added.values["start"] == pytest.approx(2.0, abs=0.2)
    begun = true.moved({"start": 2.03, "end": 3.52})
    one = sharpened_again(case, fitted(case, begun))
    assert max(one.added[0].errors.values()) < 0.012
    for name, error in one.added[0].errors.items():
        assert one.added[0].values[name] == pytest.approx(true.values[name], abs=3 * error)
    assert one.chi2 < fitted(case, true).chi2 + 4.0


def test_a_push_forth_and_back_does_not_hide_that_a_segment_integrates() -> None:
    case = planted(SLIDE, (), Sine(amplitude=10.0, frequency=1.5))  # three periods in the middle third of the log
    base, whole = base_of(case, fitted(case)), Added("scale_factor", "drive.u", {"factor": 1.02})
    assert not _forgets(base, whole, response(base, whole))
    other = base_of(still := planted(ACTUATOR, (), WAVE), fitted(still))
    whole = Added("scale_factor", "act.input", {"factor": 1.02})
    assert _forgets(other, whole, response(other, whole))


def test_edges_that_are_sought_are_no_worse_than_where_the_search_began() -> None:
    push = Multisine(amplitude=10.0, from_frequency=0.3, to_frequency=6.0, lines=25)
    true = window("drive.u", 1.9).moved({"start": 2.037, "end": 2.537})
    case = planted(SLIDE, (true,), push, noise=1e-3)
    base = base_of(case, fitted(case))
    for start, end in ((2.0, 2.6), (2.3, 2.5), (1.8, 2.9)):
        begun = true.moved({"start": start, "end": end})
        gain = base.gain(response(base, begun))[0]
        found = with_edges_fitted(base, begun)
        assert found.gain >= gain and found.gain == pytest.approx(base.gain(response(base, found.added))[0])


def test_edges_follow_what_was_found_since() -> None:
    push = Multisine(amplitude=10.0, from_frequency=0.2, to_frequency=1.0, lines=9)
    true, gain = window("drive.u", 0.6), Added("scale_factor", "drive.u", {"factor": 0.97})
    case = planted(SLIDE, (true, gain), push)
    off = fitted(case, true.moved({"start": 2.002, "end": 3.515}), gain)
    _, found = _windows_again(case, off, Carried({}))
    assert [one.kind for one in found.added] == ["transient_gain", "scale_factor"]
    for name, value in (("start", 2.0), ("end", 3.5)):
        assert found.added[0].values[name] == pytest.approx(value, abs=2e-3)


@pytest.mark.parametrize(("start", "also"), [(2.0, ["act.input", "computer.input", "computer.output"]), (2.002, [])])
def test_a_window_of_gain_between_ticks_does_the_same_behind_the_computer(start: float, also: list[str]) -> None:
    true = window("computer.input", 1.3).moved({"start": start})
    case = planted(ACTUATOR.replace('input = "u"', 'input = "d"') + COMPUTER, (true,), WAVE)
    known = fitted(case, replace(true, held=frozenset({"start", "end"})))
    case = case.whitened_by(noise_of(case, known, Carried({})))
    found = _where_windows_do_the_same(case, known, 0)
    assert sorted({*found, true.at} if also else set(found) - {true.at}) == also


def test_the_signal_that_does_nothing_but_push_is_no_coupling_of_its_derivative() -> None:
    base = base_of(case := planted(SLIDE, (), WAVE), fitted(case))
    port = find_port(base.case.segment.loop, "drive.v'")
    assert base.view.is_at(port, "u") and not base.view.is_at(port, "x")
