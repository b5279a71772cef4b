"""The clock offset and clock drift planted between two records are found, with deviations that are honest."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from delaytools.measurement.alignment import Alignment, align, aligned, merged
from delaytools.measurement.staircase import with_staircases_held
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError

Array = NDArray[np.float64]
Motion = Callable[[Array], Array]
LENGTH = 20.0


def smooth(rng: np.random.Generator) -> Motion:
    """Forty sines up to 5 Hz."""
    f, phase, size = rng.uniform(0.1, 5.0, 40), rng.uniform(0, 6.28, 40), rng.standard_normal(40) / 6
    return lambda t: np.sin(2 * np.pi * np.outer(t, f) + phase) @ size


def stairs(rng: np.random.Generator) -> Motion:
    """A command that a 200 Hz computer holds."""
    levels = rng.standard_normal(int(LENGTH * 200) + 10).cumsum()
    return lambda t: levels[np.floor(t * 200 + 1e-9).astype(int)]


def pair(
    motion: Motion,
    rng: np.random.Generator,
    *,
    offset: float = 0.0123,
    drift: float = 5e-5,
    noise: float = 0.0,
    step: float = 0.73e-3,
    held: bool = False,
) -> tuple[Record, Record]:
    """A simulation PC's log, and one of the same run on another clock, shorter and with other rows."""
    t, u = np.arange(0.0, LENGTH, 1e-3), np.arange(0.5, LENGTH - 0.3, step)
    u = np.sort(u + 0.4 * step * rng.uniform(-1, 1, len(u))) if noise else u
    one = Record(
        t, {"x": motion(t) + noise * rng.standard_normal(len(t))}, held=frozenset("x" if held else "")
    )
    return one, Record(u + offset + drift * u, {"x": motion(u) + noise * rng.standard_normal(len(u))})


CASES = {
    "clean": (smooth, {}),
    "noise, uneven rows": (smooth, {"noise": 0.1}),
    "as much noise as signal": (smooth, {"noise": 1.0}),
    "slow rows": (smooth, {"noise": 0.1, "step": 1e-2}),
    "other start and a bad clock": (smooth, {"noise": 0.1, "offset": -123.4, "drift": 1e-3}),
    "held": (stairs, {"held": True}),
    "held, noise, uneven rows": (stairs, {"held": True, "noise": 0.1}),
}


@pytest.mark.parametrize("kind, options", CASES.values(), ids=CASES)
def test_the_planted_clock_is_found(kind: Callable[..., Motion], options: dict[str, float]) -> None:
    off = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        one, two = pair(kind(rng), rng, **options)
        found = align(one, two, signal="x")
        offset = (found.offset - options.get("offset", 0.0123)) / found.offset_std
        off.append((offset, (found.drift - options.get("drift", 5e-5)) / found.drift_std))
    assert np.max(np.abs(off)) < 4.0
    assert np.all(np.sqrt(np.mean(np.square(off), axis=0)) < 1.6)
    if options.get("noise") and kind is smooth:
        assert np.all(np.sqrt(np.mean(np.square(off), axis=0)) > 0.5)


def test_deviations_are_honest_and_small() -> None:
    """Against the least that any estimate can have: sqrt(2)*noise/(rms slope*sqrt(rows)), doubled at the start."""
    errors, deviations = [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        motion = smooth(np.random.default_rng(1))
        one, two = pair(motion, rng, noise=0.2, step=1e-3)
        found = align(one, two, signal="x")
        errors.append(((found.offset - 0.0123) / found.offset_std, (found.drift - 5e-5) / found.drift_std))
        deviations.append(found.offset_std)
    assert np.all(np.abs(np.sqrt(np.mean(np.square(errors), axis=0)) - 1.0) < 0.35)
    slope = np.std(np.gradient(motion(one.time), one.time))
    least = 2 * np.sqrt(2.0) * 0.2 / (slope * np.sqrt(len(two)))
    assert least * 0.8 < np.median(deviations) < 3 * least


def test_a_staircase_on_locked_clocks_is_known_to_within_a_row() -> None:
    for held in (False, True):
        rng = np.random.default_rng(3)
        one, two = pair(stairs(rng), rng, drift=0.0, step=1e-3, held=True)
        found = align(one, with_staircases_held(two)[0] if held else two, signal="x")
        assert abs(found.offset - 0.0123) < 3 * found.offset_std
        assert found.offset_std == pytest.approx(1e-3 / np.sqrt(12), rel=0.05)


def test_clocks_that_started_long_ago() -> None:
    rng = np.random.default_rng(4)
    one, two = pair(smooth(rng), rng, noise=0.05)
    late = Record(one.time + 1e5, one.columns)
    found = align(late, two, signal="x")
    assert found.at == 1e5
    assert found.offset == pytest.approx(0.0123 - 1e5, abs=3 * found.offset_std)


def test_alignment_is_applied_in_the_open() -> None:
    rng = np.random.default_rng(5)
    motion = smooth(rng)
    one, two = pair(motion, rng)
    two = Record(two.time, {"x": two["x"], "force": two["x"] * 3}, {"force": "N"}, source="daq.csv")
    found = align(one, two, signal="x")
    new = aligned(two, found)
    assert new.time == pytest.approx(np.arange(0.5, LENGTH - 0.3, 0.73e-3), abs=1e-6)
    assert new["force"].tolist() == two["force"].tolist() and dict(new.units) == {"force": "N"}
    assert new.source == f"daq.csv; taken out: {found.words}"
    both = merged(one, new)
    assert both.names == ("x", "x_other", "force") and both.units["force"] == "N"
    assert both.time[0] == pytest.approx(0.5, abs=2e-3) and both.time[-1] == pytest.approx(19.7, abs=2e-3)
    assert set(both.time) <= set(one.time)
    assert np.max(np.abs(both["x"] - both["x_other"])) < 1e-3
    assert both["force"] == pytest.approx(3 * both["x_other"])


def test_held_signals_stay_held_when_merged() -> None:
    one = Record(np.arange(10) * 0.1, {"a": np.arange(10.0)}, {"a": "deg"}, source="pc.csv")
    two = Record(np.arange(5) * 0.2 + 0.05, {"b": np.arange(5.0), "c": np.arange(5.0)}, held=frozenset("b"))
    both = merged(one, two)
    assert both.time == pytest.approx(np.arange(1, 9) * 0.1)
    assert both["b"].tolist() == [0, 0, 1, 1, 2, 2, 3, 3] and both.held == {"b"}
    assert both["c"] == pytest.approx((both.time - 0.05) / 0.2)


def test_what_cannot_be_aligned_is_said() -> None:
    rng = np.random.default_rng(6)
    one, two = pair(smooth(rng), rng)
    t = one.time
    other = Record(t, {"x": smooth(np.random.default_rng(7))(t), "y": t}, source="daq.csv")
    wrong = {
        "no such signal in the record; found 'y'; known: x": (one, other, "y"),
        "daq.csv, x: a constant signal tells nothing of the clocks; found 2 in all": (
            one,
            Record(t, {"x": np.full(len(t), 2.0)}, source="daq.csv"),
            "x",
        ),
        "x: the records do not show the same motion of this signal; found correlation 0.": (one, other, "x"),
        "of one sign?": (one, Record(two.time, {"x": -two["x"]}), "x"),
        "too little motion of this signal to tell clock offset from clock drift; found correlation 1.00": (
            Record(t, {"x": (t > 3) * 1.0}),
            Record(t + 0.02, {"x": (t > 3) * 1.0}),
            "x",
        ),
        "records too short to be aligned; found 20 and 20 rows": (
            one.rows(slice(0, 20)),
            one.rows(slice(0, 20)),
            "x",
        ),
    }
    for words, (first, second, signal) in wrong.items():
        with pytest.raises(AnalysisError) as caught:
            align(first, second, signal=signal)
        assert words in str(caught.value), str(caught.value)
    with pytest.raises(AnalysisError, match=r"records that share no time; found 0 to .* and 100 to"):
        merged(one, Record(t + 100, {"z": t}))


def test_unlike_signals_are_not_aligned() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        one, _ = pair(smooth(rng), rng)
        _, two = pair(smooth(rng), rng)
        with pytest.raises(AnalysisError, match="do not show the same motion"):
            align(one, two, signal="x")


def test_a_sentence() -> None:
    words = Alignment(0.0123, 5e-5, 1e-5, 1e-6, 0.999, "rate").words
    assert (
        words
        == "clock offset 12.3 ± 0.01 ms at t = 0 s, clock drift 50 ± 1 µs/s, from rate (correlation 0.999)"
    )
