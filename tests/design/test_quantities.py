"""Numbers of a design: bare, with a unit, or as formulas of parameters that may have units themselves."""

import math

import pytest

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.design.stimuli import design_stimuli
from delaytools.loop.values import resolve, value_paths
from tests.design.benches import BENCH, DRIVE, effect, loaded, spoilt

VALUES = [
    ("actuator.natural_frequency", spoilt('"180 rad/s"', '"25 Hz"'), 50 * math.pi),
    ("actuator.natural_frequency", spoilt('"180 rad/s"', '"25Hz"'), 50 * math.pi),
    ("actuator.natural_frequency", spoilt('"180 rad/s"', '"1500 rpm"'), 50 * math.pi),
    ("actuator.natural_frequency", spoilt('"180 rad/s"', "180"), 180.0),
    ("actuator.damping", spoilt("0.6", '"60 %"'), 0.6),
    ("actuator.damping", spoilt("0.6", '"0.6"'), 0.6),
    ("autopilot.period", spoilt('"5 ms"', '"5000 us"'), 0.005),
    ("autopilot.period", spoilt('"5 ms"', "0.005"), 0.005),
    ("airframe.denominator[1]", spoilt("[1.0, 2.0]", '[1.0, "2*kp"]'), 0.09),
]
EFFECTS = [
    ("deg", '"0.3 deg"', 0.3),
    ("rad", '"0.3 deg"', math.radians(0.3)),
    ("deg", '"5 mrad"', math.degrees(0.005)),
    ("deg", "0.3", 0.3),
    ("rad", "0.3", 0.3),
    ("deg", '"2*kp"', 0.09),
]


@pytest.mark.parametrize("path, text, wanted", VALUES)
def test_block_values_are_in_their_own_units(path: str, text: str, wanted: float) -> None:
    assert value_paths(build(parse_design(text)))[path] == pytest.approx(wanted, rel=1e-14)


@pytest.mark.parametrize("unit, raw, wanted", EFFECTS)
def test_signal_values_are_in_the_signals_unit(unit: str, raw: str, wanted: float) -> None:
    text = effect('type = "dead_band"', 'at = "actuator.input"', f"half_width = {raw}")
    text = text.replace('fin_command = "deg"', f'fin_command = "{unit}"')
    assert value_paths(build(parse_design(text)))["effects.0.half_width"] == pytest.approx(wanted, rel=1e-14)


@pytest.mark.parametrize("raw", ["0.25", '"0.25"'])
def test_a_signal_without_a_unit_takes_bare_numbers(raw: str) -> None:
    text = effect('type = "dead_band"', 'at = "actuator.input"', f"half_width = {raw}")
    text = text[: text.index("[signals]")] + text[text.index("[blocks.autopilot]") :]
    assert value_paths(build(parse_design(text)))["effects.0.half_width"] == 0.25


@pytest.mark.parametrize(
    "lines",
    [
        'a = "2*b"\nb = "c + 1"\nc = 3.0',
        'c = 3.0\nb = "c + 1"\na = "2*b"',
        'b = "c + 1"\na = "2*b"\nc = 3.0',
    ],
)
def test_parameters_of_parameters_in_any_order(lines: str) -> None:
    found = value_paths(build(parse_design(spoilt("kp = 0.045", f"kp = 0.045\n{lines}"))))
    assert found["parameters.a"] == 8.0


def test_parameters_with_units_are_in_si() -> None:
    lines = 'kp = 0.045\nlate = "15 ms"\nwide = "0.3 deg"\nfast = "25 Hz"\nboth = "2*late"'
    found = value_paths(build(parse_design(spoilt("kp = 0.045", lines))))
    assert found["parameters.late"] == 0.015
    assert found["parameters.both"] == 0.03
    assert found["parameters.wide"] == pytest.approx(math.radians(0.3))
    assert found["parameters.fast"] == pytest.approx(50 * math.pi)


@pytest.mark.parametrize(
    "kind, key, formula, wanted",
    [
        ("dead_band", "half_width", "wide", 0.3),  # the place is in deg, the parameter an angle
        ("dead_band", "half_width", "2*wide", 0.6),
        ("dead_band", "half_width", "wider", 0.9),
        ("dead_band", "half_width", "abs(-wide) + 0*kp", 0.3),
        ("dead_band", "half_width", "fast*late", math.degrees(2 * math.pi * 7 * 0.015)),
        ("rate_limit", "limit", "wide/late", 20.0),  # deg/s
        ("delay", "delay", "late/3", 0.005),
        ("dead_band", "half_width", "late", 0.015),  # another dimension: nothing is converted
        ("dead_band", "half_width", "2*kp", 0.09),
    ],
)
def test_a_formula_of_parameters_with_units_is_in_the_unit_of_its_place(
    kind: str, key: str, formula: str, wanted: float
) -> None:
    text = effect(f'type = "{kind}"', 'at = "actuator.input"', f'{key} = "{formula}"')
    lines = 'kp = 0.045\nwide = "0.3 deg"\nlate = "15 ms"\nfast = "7 Hz"\nwider = "3*wide"'
    found = value_paths(build(parse_design(text.replace("kp = 0.045", lines))))
    assert found[f"effects.0.{key}"] == pytest.approx(wanted, rel=1e-12)


def test_the_unit_of_a_block_is_known_behind_an_effect_at_its_output() -> None:
    text = effect('type = "dead_band"', 'at = "actuator.output"', 'half_width = "0.1 deg"')
    text += '[[effects]]\ntype = "rate_limit"\nat = "actuator.rate"\nlimit = "20 deg/s"\n'
    assert value_paths(build(parse_design(text)))["effects.1.limit"] == pytest.approx(20.0)


def test_a_frequency_in_hertz_as_a_parameter() -> None:
    text = effect(
        'type = "periodic_interference"', 'at = "actuator.output"', "amplitude = 1.0", 'frequency = "f"'
    )
    found = value_paths(build(parse_design(text.replace("kp = 0.045", 'kp = 0.045\nf = "7 Hz"'))))
    assert found["effects.0.frequency"] == pytest.approx(7.0, rel=1e-14)


def test_the_frame_may_be_a_parameter() -> None:
    text = spoilt('frame = "1 ms"', 'frame = "step"').replace("kp = 0.045", 'kp = 0.045\nstep = "2 ms"')
    assert build(parse_design(text)).frame == 0.002


def test_states_of_equations_start_in_the_unit_of_their_signal() -> None:
    text = BENCH + DRIVE.replace("q = 0.0, v = 0.0", 'q = "2 deg", v = "3 deg/s"')
    text = text.replace('rate = "deg/s"', 'rate = "deg/s"\nposition = "deg"')
    found = value_paths(build(parse_design(text)))
    assert (found["drive.q"], found["drive.v"]) == (2.0, 3.0)


def test_overrides_reach_every_kind_of_value() -> None:
    text = (
        BENCH
        + DRIVE
        + (
            '\n[[effects]]\ntype = "delay"\nat = "actuator.input"\ndelay = "2 ms"\n'
            '[configurations.base]\nset = { "actuator.damping" = 0.4, "parameters.kp" = 0.05 }\n'
            'effects = [ { type = "dead_band", at = "actuator.input", half_width = "0.3 deg" } ]\n'
            '[configurations.late]\nextend = "base"\n'
            'set = { "actuator.damping" = 0.3, "actuator.gain" = 1.1, "effects.0.delay" = "3 ms", "drive.mass" = 90.0, '
            '"drive.q" = 0.5, "airframe.denominator[1]" = 3.0, "effects.1.half_width" = "0.4 deg" }\n'
        )
    )
    found = value_paths(loaded(text, "late")[1])
    wanted = {
        "actuator.damping": 0.3,
        "actuator.gain": 1.1,
        "parameters.kp": 0.05,
        "effects.0.delay": 0.003,
        "effects.1.half_width": 0.4,
        "drive.mass": 90.0,
        "drive.q": 0.5,
        "airframe.denominator[1]": 3.0,
    }
    assert {path: found[path] for path in wanted} == pytest.approx(wanted)
    assert value_paths(loaded(text)[1])["actuator.damping"] == 0.6


def test_neutral_effects_are_left_out() -> None:
    text = effect('type = "delay"', 'at = "actuator.input"', "delay = 0")
    assert not resolve(build(parse_design(text))).transports


def test_inputs_take_units_and_parameters() -> None:
    text = spoilt("kp = 0.045", 'kp = 0.045\nhard = "5 deg"\nsoft = 2.0') + (
        '[inputs]\ndemand = { type = "step", amplitude = "hard", start = "200 ms" }\n'
    )
    design, loop = loaded(text)
    step = design_stimuli(design, loop)["demand"]
    assert (step.amplitude, step.start) == (pytest.approx(5.0), 0.2)


def test_a_formula_of_time_and_parameters_drives_an_input() -> None:
    text = BENCH + '[inputs]\ndemand = { type = "formula", formula = "kp*sin(2*pi*t)" }\n'
    design, loop = loaded(text)
    import numpy as np

    t = np.linspace(0.0, 1.0, 9)
    assert design_stimuli(design, loop)["demand"].value(t) == pytest.approx(0.045 * np.sin(2 * np.pi * t))
