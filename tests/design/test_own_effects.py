"""Effects of one's own: a formula in the design file, a class of an installed package, a class for a while."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint
from typing import final

import numpy as np
import pytest

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.scale_factor import ScaleFactor
from delaytools.design import plugged
from delaytools.design.build import build
from delaytools.design.catalogue import EFFECTS, with_effects
from delaytools.design.design import Design, parse_design
from delaytools.design.edit import with_effect, with_value
from delaytools.design.knowledge import knowledge_of
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop
from delaytools.loop.values import value_paths
from delaytools.signals.stimulus import Sine
from delaytools.signals.trouble import DesignError
from delaytools.simulation.simulate import simulate

BENCH = """
[parameters]
bend = 0.2
[signals]
u = "deg"
x = "deg"
wind = "m/s"
[blocks.actuator]
type = "second_order"
input = "u"
output = "x"
natural_frequency = "60 rad/s"
damping = 0.6
[inputs]
u = { type = "sine", amplitude = 1.0, frequency = 2.0 }
"""
CURVE = """
[[effects]]
type = "formula"
at = "actuator.output"
formula = "u + k*u*abs(u)"
parameters = { k = %s }
neutral = { k = 0.0 }
"""


def x(design: Design) -> np.ndarray:
    """The exit of a run."""
    stimuli = {"u": Sine(amplitude=1.0, frequency=2.0), "wind": Sine(amplitude=0.5, frequency=0.7)}
    return simulate(build(design), stimuli, duration=1.0).record["x"]


def test_a_formula_on_a_signal() -> None:
    plain = x(parse_design(BENCH))
    assert np.allclose(
        x(parse_design(BENCH + CURVE % "0.3")), plain + 0.3 * plain * np.abs(plain), rtol=0, atol=1e-12
    )
    assert np.array_equal(x(parse_design(BENCH + CURVE % "0.0")), plain)
    assert np.array_equal(x(parse_design(BENCH + CURVE % '"bend"')), x(parse_design(BENCH + CURVE % "0.2")))


def test_a_formula_on_a_derivative_reads_states_input_and_signals() -> None:
    table = {"type": "formula", "at": "actuator.rate'", "formula": "c*v*abs(v)", "parameters": {"c": -0.5}}
    design = with_effect(parse_design(BENCH), table)
    drag = with_effect(
        parse_design(BENCH), {"type": "quadratic_drag", "at": "actuator.rate'", "coefficient": -0.5}
    )
    assert np.allclose(x(design), x(drag), rtol=0, atol=1e-12)
    stiffer = with_effect(parse_design(BENCH), {**table, "formula": "c*7200*(x - u)"})
    faster = parse_design(
        BENCH.replace('"60 rad/s"', "84.85281374238571").replace("0.6", "0.4242640687119285")
    )
    assert np.allclose(x(stiffer), x(faster), rtol=0, atol=1e-9)
    blown = with_effect(parse_design(BENCH), {**table, "formula": "c*wind*sin(t)"})
    assert np.abs(x(blown) - x(parse_design(BENCH))).max() > 1e-6


def test_its_values_have_paths_that_can_be_edited_and_configured() -> None:
    design = parse_design(BENCH + CURVE % "0.3")
    assert value_paths(build(design))["effects.0.k"] == 0.3
    assert "parameters = { k = 0.1 }" in with_value(design, "effects.0.k", 0.1).text
    configured = parse_design(design.text + '[configurations.straight]\nset = { "effects.0.k" = 0.0 }\n')
    assert value_paths(build(configured, "straight"))["effects.0.k"] == 0.0


FAULTS = {
    "an unknown name": ('formula = "u + k*w"', r"unknown name in a formula.*'w'"),
    "no formula": ("formula = 3", "a formula is wanted here"),
    "code": ('formula = "__import__(1)"', "not allowed in the formula"),
    "an unknown key": ('formula = "u"\nfactor = 2', "unknown value.*'factor'"),
    "false neutral values": (
        'formula = "u + 1 + k"\nneutral = { k = 0.0 }',
        "changes something at its neutral",
    ),
    "neutral of no parameter": ('formula = "u"\nneutral = { q = 0.0 }', "neutral value of no parameter.*'q'"),
    "a name with two meanings": ('formula = "u"\nneutral = {}\n', "one name with two meanings"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_named(name: str) -> None:
    lines, words = FAULTS[name]
    own = "{ u = 1.0 }" if "two meanings" in name else "{ k = 0.1 }"
    text = f'{BENCH}[[effects]]\ntype = "formula"\nat = "actuator.input"\nparameters = {own}\n{lines}\n'
    with pytest.raises(DesignError, match=words):
        build(parse_design(text))


@final
@dataclass(frozen=True, kw_only=True)
class WornEffect(Effect):
    """y = (1 - wear) u."""

    wear: Scalar = value(low=0.0, neutral=0.0)

    kind = "worn"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge("What.", "Cause.", "Margins.", "Check.")

    def apply(self, loop: Loop, place: Place) -> Loop:
        return insert_at(loop, place, self, ScaleFactor(factor=1 - self.wear))


WORN = BENCH + '[[effects]]\ntype = "worn"\nat = "actuator.output"\nwear = 0.25\n'


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., plugged.Kinds]:
    """The catalogue where packages offer these entry points."""

    def offering(*points: str) -> plugged.Kinds:
        found = [EntryPoint(f"n{k}", point, plugged.GROUP) for k, point in enumerate(points)]
        monkeypatch.setattr(plugged, "entry_points", lambda group: found if group == plugged.GROUP else [])
        kinds = replace(EFFECTS)
        for room in ("entries", "configurations", "knowledge"):
            monkeypatch.setattr(f"delaytools.design.{room}.EFFECTS", kinds)
        return kinds

    return offering


def test_a_package_offers_an_effect(installed: Callable[..., plugged.Kinds]) -> None:
    kinds = installed(f"{__name__}:WornEffect")
    assert kinds["worn"] is WornEffect and "worn" in list(kinds) and len(kinds) == len(EFFECTS) + 1
    assert np.allclose(x(parse_design(WORN)), 0.75 * x(parse_design(BENCH)), rtol=0, atol=1e-12)
    assert knowledge_of("worn").what == "What."


def test_packages_are_asked_only_where_the_catalogue_does_not_know(
    installed: Callable[..., plugged.Kinds],
) -> None:
    kinds = installed("nowhere.at_all:Thing")
    assert "delay" in kinds and kinds["delay"].kind == "delay"
    with pytest.raises(DesignError, match=r"cannot be loaded.*nowhere"):
        _ = kinds["worn"]


@pytest.mark.parametrize(
    ("point", "words"),
    [("math:pi", "no kind of effect"), ("delaytools.effects.delay:DelayEffect", "taken"),
     ("delaytools.effects.effect:Effect", "no kind of effect")],
)  # fmt: skip
def test_what_is_no_effect_is_refused(
    installed: Callable[..., plugged.Kinds], point: str, words: str
) -> None:
    with pytest.raises(DesignError, match=words):
        list(installed(point))


def test_a_program_offers_an_effect_for_a_while() -> None:
    with with_effects(WornEffect):
        assert np.allclose(x(parse_design(WORN)), 0.75 * x(parse_design(BENCH)), rtol=0, atol=1e-12)
        with pytest.raises(DesignError, match="taken"), with_effects(WornEffect):
            pass
    assert "worn" not in EFFECTS
    with pytest.raises(DesignError, match="unknown effect type"):
        build(parse_design(WORN))
