"""Disk margins of several signals at once, and how much a delay may vary."""

from itertools import pairwise

import control as ct
import numpy as np
import pytest

from delaytools.analysis.disk_margins import loop_disk_margin, simultaneous_disk_margin
from delaytools.analysis.jitter import jitter_margin
from delaytools.analysis.margins import margins
from delaytools.analysis.questions import loop_margins
from delaytools.analysis.stability import roots_not_left
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.linear.algebra import delay, feedback
from delaytools.linear.delay_system import DelaySystem, as_delay_system
from delaytools.signals.trouble import AnalysisError

LOOPS = {
    "thesis 3.8": delay(0.02) * ct.tf([3 * 14050.0], np.polymul([1.0, 17.86, 14050.0], [0.5, 1.0])),
    "integrator": delay(0.1) * ct.tf([4.0], [1.0, 0.0]),
    "allmargin": as_delay_system(ct.tf([25.0], [1.0, 10.0, 10.0, 10.0])),
}


def spinning() -> DelaySystem:
    """The rotating body of Seiler, Packard & Gahinet (2020): single loops look robust, both together are not."""
    a = 10.0
    A, B = np.array([[0.0, a], [-a, 0.0]]), np.eye(2)
    C = np.array([[1.0, a], [-a, 1.0]])
    return as_delay_system(ct.ss(A, B, C, np.zeros((2, 2))))


@pytest.mark.parametrize("name", LOOPS)
def test_of_one_signal_it_is_the_disk_margin(name: str) -> None:
    found, single = simultaneous_disk_margin(LOOPS[name]), margins(LOOPS[name])
    assert found.margin == pytest.approx(single.disk_margin, rel=1e-6)
    assert found.at_most == pytest.approx(found.margin, rel=1e-9)


def test_both_loops_of_a_spinning_body() -> None:
    """One at a time L = 1/s, α = 2; both at once a few per cent, and gains just past those named lose stability."""
    L = spinning()
    found = simultaneous_disk_margin(L)
    one_open = feedback(L, np.diag([0.0, 1.0]))[0, 0]  # the other loop closed
    assert margins(one_open).disk_margin == pytest.approx(2.0, abs=1e-6)
    assert found.margin < 0.25 and found.at_most >= found.margin * (1 - 1e-9)
    f = 1 + 1.02 * (found.gain - 1)  # a little past the guaranteed gains, opposite in the two channels: what is lost
    worst = max(roots_not_left(feedback(L, np.diag([g, 1 / g]))) for g in (f, 1 / f))
    inside = 1 + 0.98 * (found.gain - 1)
    assert worst > 0
    pairs = [(g, h) for g in (inside, 1 / inside) for h in (inside, 1 / inside)]
    assert all(roots_not_left(feedback(L, np.diag(pair))) == 0 for pair in pairs)


CHAIN = """
frame = "1 ms"
[blocks.plant]
type = "transfer_function"
input = "u"
output = "y"
numerator = [8.0]
denominator = [1.0, 2.0, 0.0]
[blocks.table]
type = "delay"
input = "y"
output = "z"
delay = "60 ms"
[blocks.law]
type = "gain"
input = "-z"
output = "u"
gain = 1.0
[analysis]
at = "u"
"""


def test_signals_of_one_loop_share_its_margin() -> None:
    """Two places of a single loop: gains multiply, so both together stand half of what one alone may take."""
    loop = build(parse_design(CHAIN))
    alone = loop_margins(loop, "u").margins[0].disk_margin
    both = loop_disk_margin(loop, ["u", "y"])
    assert loop_disk_margin(loop, ["u"]).margin == pytest.approx(alone, rel=1e-6)
    assert 0.4 * alone < both.margin < 0.6 * alone


def test_an_unstable_loop_has_no_margin() -> None:
    assert simultaneous_disk_margin(delay(1.0) * ct.tf([4.0], [1.0, 0.0])).margin == 0.0


def test_jitter_of_a_first_order_loop() -> None:
    """L = k/s: T = k/(s + k), ω |T| rises to k: margin 1/k, decided beyond all frequencies."""
    found = jitter_margin(as_delay_system(ct.tf([5.0], [1.0, 0.0])))
    assert found.margin == pytest.approx(0.2, rel=1e-6) and found.frequency == np.inf


def test_jitter_of_a_second_order_loop() -> None:
    """L = w²/(s (s + 2 z w)): ω |T| is largest at ω = w, where it is w/(2 z)."""
    w, z = 6.0, 0.4
    found = jitter_margin(as_delay_system(ct.tf([w**2], [1.0, 2 * z * w, 0.0])))
    assert found.margin == pytest.approx(2 * z / w, rel=1e-9) and found.frequency == pytest.approx(w, rel=1e-5)


@pytest.mark.parametrize("name", LOOPS)
def test_a_constant_delay_is_a_varying_one(name: str) -> None:
    assert jitter_margin(LOOPS[name]).margin <= margins(LOOPS[name]).delay_margin * (1 + 1e-9)


@pytest.mark.parametrize("rate", [0.0, 0.3, 0.7, 0.99, 1.0, 5.0])
def test_jitter_of_an_integrator_whose_delay_varies_slowly(rate: float) -> None:
    """L = 1/s: (1 + b) + (1 - b/(1 - rate))/ω² is least with b = 1 - rate: margin √(2 - rate), 1 from rate 1 on."""
    found = jitter_margin(as_delay_system(ct.tf([1.0], [1.0, 0.0])), rate)
    assert found.margin == pytest.approx(np.sqrt(2 - min(rate, 1.0)), rel=1e-6)


@pytest.mark.parametrize("name", LOOPS)
def test_what_varies_slowly_may_vary_more_but_no_more_than_a_constant_delay(name: str) -> None:
    found = [jitter_margin(LOOPS[name], rate).margin for rate in (0.0, 0.2, 0.8, np.inf)]
    assert all(slow >= fast * (1 - 1e-9) for slow, fast in pairwise(found))
    assert found[0] <= margins(LOOPS[name]).delay_margin * (1 + 1e-9)


def test_a_negative_rate_is_refused() -> None:
    with pytest.raises(AnalysisError):
        jitter_margin(as_delay_system(ct.tf([1.0], [1.0, 0.0])), -0.1)


def test_what_passes_at_all_frequencies_bears_no_jitter() -> None:
    assert jitter_margin(as_delay_system(ct.tf([0.5, 1.0], [1.0, 1.0]))).margin == 0.0
