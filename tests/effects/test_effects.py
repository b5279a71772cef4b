"""The contract of every effect: neutral is nothing, planted it shows, it knows its place and its cause."""

from dataclasses import fields, replace

import numpy as np
import pytest

from delaytools.blocks.block import flat_values, specifications
from delaytools.blocks.first_order import FirstOrder
from delaytools.effects.bias import BiasEffect
from delaytools.effects.cubic_stiffness import CubicStiffnessEffect
from delaytools.effects.dropped_frames import DroppedFramesEffect
from delaytools.effects.effect import Effect
from delaytools.effects.formula import FormulaEffect
from delaytools.effects.parameter_change import ParameterChange
from delaytools.effects.saturation import SaturationEffect
from delaytools.effects.scale_factor import ScaleFactorEffect
from delaytools.effects.transient_gain import TransientGainEffect
from delaytools.effects.variable_delay import VariableDelayEffect
from delaytools.loop.edit import remove
from delaytools.loop.linearise import linearise
from delaytools.loop.values import resolve, value_paths
from delaytools.signals.trouble import DesignError
from tests.effects.family import CLASSES, FAMILY
from tests.effects.servo import alone, placed, rows, servo

NONLINEAR = {"dead_band", "backlash", "saturation", "rate_limit", "quantization", "dropped_frames"}
NONLINEAR |= {"coulomb_friction", "stribeck_friction", "load_dependent_friction"}
WRONG = {
    "input": "actuator.input",
    "derivative": "actuator.rate'",
    "block": "actuator",
    "rate": "actuator.rate",
}


def neutral(effect: Effect) -> Effect:
    """The effect at its neutral value."""
    if isinstance(effect, ParameterChange):
        return replace(effect, new=None)
    if isinstance(effect, FormulaEffect):
        return replace(effect, parameters=effect.neutral)
    specs = {n: s for n, s in specifications(effect).items() if s.neutral is not None}
    return replace(effect, **{n: s.neutral for n, s in specs.items() if getattr(effect, n) is not None})


@pytest.fixture(scope="module")
def plain() -> dict[str, np.ndarray]:
    return rows(servo("sampled"))


@pytest.mark.parametrize("name", [n for n in FAMILY if "column" not in n])
def test_neutral_leaves_every_bit(name: str, plain: dict[str, np.ndarray]) -> None:
    effect, at = FAMILY[name]
    run = rows(placed(servo("sampled"), neutral(effect), at))
    for signal, column in plain.items():
        assert np.array_equal(run[signal], column), signal


@pytest.mark.parametrize("name", FAMILY)
def test_planted_it_shows(name: str, plain: dict[str, np.ndarray]) -> None:
    effect, at = FAMILY[name]
    loop = placed(servo("sampled"), effect, at)
    run = rows(loop)
    assert np.max(np.abs(run["probed"] - plain["probed"])) > 1e-3
    assert np.all(np.isfinite(run["probed"]))


@pytest.mark.parametrize("name", [n for n in FAMILY if "parameter" not in n])
def test_removed_it_is_gone(name: str, plain: dict[str, np.ndarray]) -> None:
    effect, at = FAMILY[name]
    loop = remove(placed(servo("sampled"), effect, at), f"{effect.kind}@{at}")
    assert np.array_equal(rows(loop)["probed"], plain["probed"])


@pytest.mark.parametrize("name", [n for n in FAMILY if "parameter" not in n])
def test_every_value_has_its_path(name: str) -> None:
    effect, at = FAMILY[name]
    paths = value_paths(placed(servo("sampled"), effect, at, index=3))
    for value, number in flat_values(effect).items():
        if not (isinstance(effect, VariableDelayEffect) and effect.signal):
            assert paths[f"effects.3.{value}"] == number


@pytest.mark.parametrize("effect", CLASSES, ids=lambda e: e.kind)
def test_knowledge_and_linearity(effect: Effect) -> None:
    texts = [getattr(effect.knowledge, field.name) for field in fields(effect.knowledge)]
    assert all(len(text) > 30 and text.endswith(".") for text in texts)
    assert len(set(texts)) == 4
    assert effect.amplitude_dependent == (effect.kind in NONLINEAR)


def test_no_two_effects_say_the_same() -> None:
    kinds = [effect.kind for effect in CLASSES]
    assert len(set(kinds)) == len(kinds) == 26
    for part in ("what", "cause", "margins", "check"):
        texts = [getattr(effect.knowledge, part) for effect in CLASSES]
        assert len(set(texts)) == len(texts), part


@pytest.mark.parametrize("name", [n for n, (e, _) in FAMILY.items() if e.amplitude_dependent])
def test_linear_analysis_leaves_it_out(name: str) -> None:
    effect, at = FAMILY[name]
    loop = placed(servo("sampled"), effect, at)
    assert linearise(loop, ["demand"]).without == (f"{effect.kind}@{at}",)


@pytest.mark.parametrize("effect", CLASSES, ids=lambda e: e.kind)
def test_a_wrong_port_is_named(effect: Effect) -> None:
    for kind, at in WRONG.items():
        if kind not in effect.acts_on:
            with pytest.raises(DesignError) as caught:
                placed(servo(), effect, at)
            assert caught.value.known == effect.acts_on
            assert at in str(caught.value) and kind in caught.value.found


@pytest.mark.parametrize("at", ["probe.output", "probe.input"])
def test_effects_at_one_port_act_in_file_order(at: str) -> None:
    limit, scale, bias = SaturationEffect(limit=0.2), ScaleFactorEffect(factor=2.0), BiasEffect(level=0.1)
    first = rows(placed(placed(placed(servo(), limit, at), scale, at, 1), bias, at, 2))
    last = rows(placed(placed(placed(servo(), bias, at), scale, at, 1), limit, at, 2))
    assert np.allclose(first["probed"], 2 * np.clip(first["measured"], -0.2, 0.2) + 0.1, rtol=0, atol=1e-15)
    assert np.allclose(last["probed"], np.clip(2 * (last["measured"] + 0.1), -0.2, 0.2), rtol=0, atol=1e-15)


def test_errors_say_what_to_do() -> None:
    with pytest.raises(DesignError, match=r"first-order state.*second_order"):
        placed(
            alone(FirstOrder(time_constant=0.1)), CubicStiffnessEffect(coefficient=1.0), "actuator.output'"
        )
    with pytest.raises(DesignError, match=r"SecondOrder block.*known: sampler.output"):
        placed(servo(), DroppedFramesEffect(probability=0.1), "actuator.output")
    with pytest.raises(DesignError, match=r"natural_freq'.*damping.*nearest: natural_frequency"):
        placed(servo(), ParameterChange(name="natural_freq", new=1.0), "actuator")
    with pytest.raises(DesignError, match="neither mean nor signal"):
        VariableDelayEffect()
    with pytest.raises(DesignError, match="give frequency"):
        VariableDelayEffect(mean=0.01, amplitude=0.002)
    with pytest.raises(DesignError, match="ends after it starts"):
        TransientGainEffect(factor=0.5, start=2.0, end=1.0)


def test_a_changed_parameter_is_another_block() -> None:
    slower = placed(servo(), ParameterChange(name="natural_frequency", new=30.0), "actuator")
    assert resolve(slower)["actuator"].block.natural_frequency == 30.0
    assert value_paths(slower)["effects.0.natural_frequency"] == 30.0
    draggier = placed(servo(), ParameterChange(name="denominator[1]", new=3.0), "plant")
    assert resolve(draggier)["plant"].block.denominator == (1.0, 3.0)
