"""The sweep against single answers, and its intervals against certified counts."""

import control
import numpy as np
import pytest

from delaytools.analysis.characteristic_roots import unstable_count
from delaytools.analysis.delay_sweep import delay_windows, sweep_channel, sweep_margins
from delaytools.analysis.margins import margins
from delaytools.analysis.stability import closed_loop_of
from delaytools.linear.algebra import delay, feedback
from delaytools.linear.delay_system import DelaySystem, as_delay_system
from delaytools.signals.trouble import AnalysisError

VALUES = (
    "gain_margin", "gain_margin_frequency", "phase_margin", "phase_margin_frequency",
    "delay_margin", "modulus_margin", "disk_margin",
)  # fmt: skip

PLANTS = {
    "thesis 3.8": as_delay_system(control.tf([3 * 14050.0], np.polymul([1.0, 17.86, 14050.0], [0.5, 1.0]))),
    "lightly damped": as_delay_system(control.tf([0.06, 0.24, 0.18], [1.0, 0.3, 1.0, 0.0])),
    "three crossovers": as_delay_system(
        control.tf([100.0, 200.0, 10000.0], [0.002, 1.008, 4.406, 203.4, 200.0, 0.0])
    ),
    "unstable plant": as_delay_system(control.tf([4.0, 3.0], [1.0, -1.0, 0.0])),
    "with a delay inside": feedback(as_delay_system(control.tf([1.0], [1.0, 1.0])), 0.5 * delay(0.8))
    * as_delay_system(control.tf([0.6], [1.0, 0.0])),
}
SPANS = {"thesis 3.8": 0.3, "lightly damped": 8.0, "three crossovers": 0.05, "unstable plant": 0.4,
         "with a delay inside": 5.0}  # fmt: skip


@pytest.mark.parametrize("name", PLANTS)
def test_sweep_is_the_single_answers(name: str) -> None:
    L = PLANTS[name]
    delays = np.linspace(0.0, SPANS[name], 13)
    for tau, swept in zip(delays, sweep_margins(L, delays).margins, strict=True):
        single = margins(delay(tau) * L)
        assert swept.stable == single.stable and swept.delay == tau
        for value in VALUES:
            expected = getattr(single, value)
            found = getattr(swept, value)
            assert found == expected if expected is None else found == pytest.approx(expected, rel=1e-9), (
                value
            )


@pytest.mark.parametrize("name", PLANTS)
def test_counts_along_the_sweep_are_certified_ones(name: str) -> None:
    L, limit = PLANTS[name], 4 * SPANS[name]
    windows = delay_windows(L, limit)
    ends = np.concatenate([[0.0], windows.delays[:6], [limit]])
    for tau in 0.5 * (ends[:-1] + ends[1:])[: len(windows.delays) + 1]:
        if np.min(np.abs(windows.delays - tau), initial=np.inf) < 1e-6 * limit or tau > ends[-2] < limit:
            continue
        found = unstable_count(closed_loop_of(delay(tau) * L))
        assert found.certified
        assert windows.unstable_counts(np.array([tau]))[0] == found.count


def test_ends_of_the_stable_interval_have_a_root_on_the_axis() -> None:
    L = PLANTS["unstable plant"]
    ((low, high),) = sweep_margins(L, np.linspace(0.0, 0.4, 5)).stable_delays
    assert low == 0.0
    assert high == pytest.approx(margins(L).delay_margin, rel=1e-13)
    assert sweep_margins(L, [high]).table.modulus_margin[0] < 1e-10
    assert not sweep_margins(L, [high]).stable[0]


def test_islands_of_stability() -> None:
    # undamped plant with delayed feedback of the wrong sign: stable only with delay, in several intervals
    # s^2 + 1 - 0.2 e^{-sτ}; crossings at w^2 = 0.8, τ = 2πm/w, stabilising and at w^2 = 1.2, τ = (2m+1)π/w
    L = as_delay_system(control.tf([-0.2], [1.0, 0.0, 1.0]))
    intervals = sweep_margins(L, np.linspace(0.0, 20.0, 41)).stable_delays
    low, high = np.sqrt(0.8), np.sqrt(1.2)
    expected = [(0.0, np.pi / high), (2 * np.pi / low, 3 * np.pi / high), (4 * np.pi / low, 5 * np.pi / high)]
    assert expected[2][0] < expected[2][1] and 5 * np.pi / high < 6 * np.pi / low
    expected = [pair for pair in expected if pair[0] < pair[1]]
    assert [list(pair) for pair in intervals] == [pytest.approx(list(pair), rel=1e-12) for pair in expected]


def test_delay_elsewhere_in_the_loop() -> None:
    # the rate loop inside holds the swept delay, the loop is opened outside of it
    plant = as_delay_system(control.tf([2.0], [1.0, 1.0]))
    inner = feedback(plant, delay(0.0) * as_delay_system(1.0))
    L = inner * as_delay_system(control.tf([0.8], [1.0, 0.0]))
    delays = np.linspace(0.0, 3.0, 7)
    answers, intervals = sweep_channel(L, 0, delays)
    for tau, answer in zip(delays, answers, strict=True):
        count = unstable_count(closed_loop_of(L.with_spans([tau])))
        assert answer.stable == (count.count == 0)
        assert answer.stable == any(a <= tau <= b for a, b in intervals)
    for a, b in intervals:
        for end in {a, b} - {0.0, 3.0}:
            assert (
                margins(L.with_spans([end * (1 - 1e-7)])).stable
                != margins(L.with_spans([end * (1 + 1e-7)])).stable
            )
    assert any(0.0 < b < 3.0 for _, b in intervals)


def test_direct_gain_is_stable_without_delay_only() -> None:
    L = as_delay_system(control.tf([2.0, 2.0], [1.0, 3.0]))
    swept = sweep_margins(L, [0.0, 0.1])
    assert swept.stable == (True, False) and swept.stable_delays == ((0.0, 0.0),)


def test_marginal_at_no_delay() -> None:
    # 1/s^2 is on the axis without delay and unstable with any
    L: DelaySystem = as_delay_system(control.tf([1.0], [1.0, 0.2, 1.0])) * as_delay_system(
        control.tf([0.2], [1.0, 0.0])
    )
    swept = sweep_margins(L, [0.0, 0.1])
    assert swept.stable == (False, False) and swept.stable_delays == ()


@pytest.mark.parametrize("delays", [[-0.1], [], [np.nan]])
def test_wrong_delays(delays: list[float]) -> None:
    with pytest.raises(AnalysisError, match="delay"):
        sweep_margins(PLANTS["thesis 3.8"], delays)
