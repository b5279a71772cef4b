"""Units, quantities, formulas and stimuli: what is read, and what is refused in words."""

import math

import numpy as np
import pytest

from delaytools.signals.expression import Expression, check_name
from delaytools.signals.stimulus import (
    Chirp,
    Column,
    Doublet,
    Formula,
    Multisine,
    Noise,
    Pulse,
    Sine,
    Step,
    jumping,
)
from delaytools.signals.trouble import DelaytoolsError, DesignError, UnitError, shown
from delaytools.signals.units import convert, quantity, unit


@pytest.mark.parametrize(
    "number, source, target, wanted",
    [
        (25.0, "Hz", "rad/s", 50 * math.pi),
        (1.0, "rpm", "deg/s", 6.0),
        (5.0, "ms", "s", 0.005),
        (5.0, "us", "ms", 0.005),
        (5.0, "µs", "us", 5.0),
        (180.0, "deg", "rad", math.pi),
        (50.0, "%", "", 0.5),
        (2.0, "%/s", "1/s", 0.02),
        (1.0, "g", "m/s^2", 9.80665),
        (1.0, "N*m", "Nm", 1.0),
        (3.0, "deg/s/s", "deg/s²", 3.0),
        (3.0, "m/s**2", "m/s2", 3.0),
    ],
)
def test_units_convert(number: float, source: str, target: str, wanted: float) -> None:
    assert convert(number, source, target) == pytest.approx(wanted, rel=1e-14)
    assert convert(convert(number, source, target), target, source) == pytest.approx(number, rel=1e-14)


@pytest.mark.parametrize("symbol", ["m/2", "s*", "deg//s", "/s", "rad s", "degs", "rad/sec", "s^x"])
def test_what_is_no_unit(symbol: str) -> None:
    with pytest.raises(UnitError, match=r"unknown unit.*known: rad"):
        unit(symbol)


@pytest.mark.parametrize(
    "source, target", [("deg", "s"), ("Hz", "s"), ("", "deg"), ("deg", ""), ("1/s", "Hz")]
)
def test_wrong_dimensions(source: str, target: str) -> None:
    with pytest.raises(UnitError, match=r"wrong dimension; found .*give"):
        convert(1.0, source, target)


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("15 ms", (15.0, "ms")),
        ("15ms", (15.0, "ms")),
        ("-.5e-3 deg/s", (-0.0005, "deg/s")),
        ("7", (7.0, "")),
        ("inf", (math.inf, "")),
        ("2 1/s", (2.0, "1/s")),
        ("6 %", (6.0, "%")),
        ("2*kp", None),
        ("kp", None),
        ("3/4", None),
        ("", None),
    ],
)
def test_quantities(text: str, wanted: tuple[float, str] | None) -> None:
    assert quantity(text) == wanted


def test_a_derivative_of_a_number_has_a_unit_that_can_be_read() -> None:
    assert unit(unit("").per_second().symbol).powers == unit("1/s").powers
    assert unit(unit("deg").per_second(2).symbol).powers == unit("deg/s^2").powers


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("2*x**2 - 1", 17.0),
        ("-x + +3", 0.0),
        ("min(x, 2, 1) + max(x, 7)", 8.0),
        ("abs(-x)*sign(-2)", -3.0),
        ("sin(pi/2) + cos(0) + tan(0) + tanh(0)", 2.0),
        ("exp(log(sqrt(x**2)))", 3.0),
        ("\n  x\n  + 1\n", 4.0),
    ],
)
def test_formulas(text: str, wanted: float) -> None:
    assert Expression(text).evaluate({"x": 3.0}) == pytest.approx(wanted)


def test_names_of_a_formula_in_their_order() -> None:
    assert Expression("b*sin(a) + b - pi").names == ("b", "a")


@pytest.mark.parametrize("text, word", [("1/x", "division by zero"), ("9.0**(9.0**9 + x)", "too large")])
def test_a_formula_without_a_value(text: str, word: str) -> None:
    with pytest.raises(DesignError, match=word):
        Expression(text).evaluate({"x": 0.0})


def test_an_unknown_name_is_said_with_the_nearest() -> None:
    with pytest.raises(DesignError, match=r"unknown name.*'raet'.*known: fin, rate; nearest: rate"):
        Expression("2*raet").evaluate({"rate": 1.0, "fin": 2.0})


def test_a_keyword_as_a_name_is_explained() -> None:
    with pytest.raises(DesignError, match="lambda cannot be a name in a formula: rename it"):
        Expression("lambda*x")


@pytest.mark.parametrize("name", ["pi", "sin", "lambda", "2x", "a b", "a-b", "a.b", ""])
def test_names_that_no_formula_could_read(name: str) -> None:
    with pytest.raises(DesignError, match="cannot be the name of a signal"):
        check_name(name, "signal")


def test_long_findings_are_cut() -> None:
    assert len(shown("x" * 1000)) <= 81
    assert shown("short") == "'short'"


def test_an_error_keeps_its_kind_and_gains_a_place() -> None:
    error = UnitError("wrong", where="b", found="1", known=("2",), advice="do").at("a")
    assert isinstance(error, UnitError) and isinstance(error, DelaytoolsError)
    assert str(error) == "a: b: wrong; found 1; known: 2; do"


def test_stimuli_at_their_jumps() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    assert Step(amplitude=2.0, start=0.2).value(t).tolist() == [0, 0, 2, 2, 2]
    assert Pulse(amplitude=2.0, start=0.1, width=0.1).value(t).tolist() == [0, 2, 0, 0, 0]
    assert Doublet(amplitude=2.0, start=0.1, width=0.1).value(t).tolist() == [0, 2, -2, 0, 0]
    assert Sine(amplitude=2.0, frequency=2.5).value(t) == pytest.approx(2 * np.sin(5 * np.pi * t))
    assert Formula(formula=Expression("3")).value(t).tolist() == [3.0] * 5


def test_amplitudes_are_what_they_say() -> None:
    t = np.arange(0.0, 100.0, 1e-3)
    wave = Multisine(amplitude=2.0, from_frequency=0.5, to_frequency=10.0, lines=20).value(t)
    assert np.sqrt(np.mean(wave**2)) == pytest.approx(2.0, rel=1e-3)
    noise = Noise(rms=2.0, period=1e-3, seed=3).value(t)
    assert np.std(noise) == pytest.approx(2.0, rel=0.02)
    chirp = Chirp(amplitude=2.0, from_frequency=0.5, to_frequency=10.0, duration=50.0).value(t)
    assert np.max(np.abs(chirp)) == pytest.approx(2.0, rel=1e-3)
    assert not chirp[t >= 50.0].any()


def test_a_formula_of_time_without_a_value_says_when() -> None:
    with pytest.raises(DesignError, match=r"no finite value; found '1/\(t - 1\)' at t = 1 s"):
        Formula(formula=Expression("1/(t - 1)")).value(np.array([0.0, 1.0, 2.0]))


def test_a_smooth_column_bridges_a_jump_by_a_straight_line_and_curves_elsewhere() -> None:
    time = np.arange(0.0, 1.0, 0.01)
    curve = np.sin(7 * time)
    values = curve + np.where(time > 0.495, 5.0, 0.0)
    column = Column(time=time, values=values, smooth=True)
    between = time[:-1] + 0.005
    found = column.value(between) - np.where(between > 0.495, 5.0, 0.0)
    far = np.abs(between - 0.495) > 0.006
    assert np.abs(found - np.sin(7 * between))[far].max() < 2e-5
    assert column.value(np.array([0.4925])) == pytest.approx(0.75 * values[49] + 0.25 * values[50])
    whole = Column(time=time, values=curve, smooth=True)
    assert np.abs(whole.value(between) - np.sin(7 * between)).max() < 2e-6


@pytest.mark.parametrize(
    ("rows", "jumps"),
    [
        ([0, 0, 0, 0, 5, 5, 5, 5], [3]),
        ([0, 0, 0, 0, 5, 0, 0, 0], []),
        ([0, 1, 2, 3, 4, 5, 6, 7], []),
        ([0, 0, 0, 1, 4, 9, 16, 25], []),
        ([0, 0.1, 0.2, 0.3, 5.4, 5.5, 5.6, 5.7], [3]),
    ],
)
def test_a_jump_is_far_larger_than_the_steps_on_either_side(rows: list[float], jumps: list[int]) -> None:
    assert np.flatnonzero(jumping(np.diff(np.array(rows, dtype=float)))).tolist() == jumps


def test_a_gap_in_time_is_no_jump() -> None:
    time = np.delete(np.arange(0.0, 1.0, 0.01), slice(50, 56))
    column = Column(time=time, values=np.sin(3 * time), smooth=True)
    assert column.value(np.array([0.52])) == pytest.approx(np.sin(3 * 0.52), abs=1e-4)
