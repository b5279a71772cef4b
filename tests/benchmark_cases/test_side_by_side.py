"""A clock on which work done one after the other counts as side by side."""

import time

import pytest

from benchmarks.hidden_effects.side_by_side import Lanes, side_by_side
from delaytools.diagnosis import case, diagnose

LONG, SHORT = 0.12, 0.04


def _busy(seconds: float) -> float:
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass
    return seconds


@pytest.mark.parametrize(
    ("lanes", "work", "passes", "order"),
    [
        (1, [LONG, SHORT], LONG + SHORT, [0, 1]),
        (2, [LONG, SHORT], LONG, [1, 0]),
        (2, [LONG, SHORT, SHORT], LONG, [1, 2, 0]),
        (2, [SHORT, LONG, LONG], SHORT + LONG, [0, 1, 2]),
    ],
)
def test_a_round_takes_as_long_as_its_longest_lane(
    lanes: int, work: list[float], passes: float, order: list[int]
) -> None:
    clock = Lanes(lanes)
    begin = clock.monotonic()
    found = list(clock.share(_busy, work))
    assert clock.monotonic() - begin == pytest.approx(passes, abs=0.02)
    assert found == [(place, work[place]) for place in order]


def test_what_else_the_machine_does_does_not_count() -> None:
    clock = Lanes(2)
    begin = clock.monotonic()
    time.sleep(0.1)
    assert clock.monotonic() - begin < 0.05


def test_a_diagnosis_reads_the_clock_of_its_lanes() -> None:
    with side_by_side(2) as lanes:
        assert case.time is lanes and diagnose.time is lanes
    assert case.time is time and diagnose.time is time
