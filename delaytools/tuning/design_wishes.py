"""The [tuning] table of a design as wishes."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from delaytools.design.design import Design
from delaytools.design.faults import Faults
from delaytools.design.values import number
from delaytools.signals.trouble import DesignError
from delaytools.tuning.goals import (
    BandError,
    GainMargin,
    Goal,
    ModulusMargin,
    NoiseGain,
    PhaseMargin,
    Range,
    Wishes,
)

__all__ = ["GOAL_KEYS", "design_wishes"]

GOAL_KEYS: dict[str, tuple[str, ...]] = {
    "band_error": ("band", "weight", "max", "over"),
    "noise_gain": ("max", "of", "over"),
    "phase_margin": ("min", "over"),
    "gain_margin": ("min", "over"),
    "modulus_margin": ("min", "over"),
}


def design_wishes(design: Design) -> Wishes:
    """What the design's [tuning] wants varied and wished; raises DesignError naming every fault."""
    table = design.tables.tuning
    faults = Faults(design.name)
    vary: dict[str, Range] = {}
    for name, raw in table.vary.items():
        with faults.at(f"tuning.vary.{name}"):
            vary[name if "." in name else f"parameters.{name}"] = _range(raw, "")
    goals: list[Goal] = []
    for index, raw_goal in enumerate(table.goals):
        with faults.at(f"tuning.goals.{index}"):
            goals.append(_goal(raw_goal))
    faults.settle()
    if not vary or not goals:
        raise DesignError(
            "the design wishes nothing", where=f"{design.name}: tuning", advice="give vary and goals"
        )
    return Wishes(vary, tuple(goals))


def _goal(table: Mapping[str, Any]) -> Goal:
    kind = table.get("type")
    if kind not in GOAL_KEYS:
        raise DesignError("unknown goal", found=repr(kind), known=GOAL_KEYS)
    for key in table:
        if key != "type" and key not in GOAL_KEYS[kind]:
            raise DesignError(f"unknown value of a {kind} goal", found=repr(key), known=GOAL_KEYS[kind])
    over = {name: _range(raw, "s" if name == "delay" else "") for name, raw in table.get("over", {}).items()}
    return _MAKERS[kind](table, over)


def _band_error(table: Mapping[str, Any], over: Mapping[str, Range]) -> Goal:
    if "band" not in table:
        raise DesignError(
            "missing required value", found="a band_error without band", advice="give band in Hz"
        )
    most = number(table["max"], "") if "max" in table else None
    return BandError(
        band=_range(table["band"], "Hz"), weight=number(table.get("weight", 1.0), ""), most=most, over=over
    )


def _noise_gain(table: Mapping[str, Any], over: Mapping[str, Range]) -> Goal:
    return NoiseGain(most=_bound(table, "max", ""), of=table.get("of"), over=over)


def _phase_margin(table: Mapping[str, Any], over: Mapping[str, Range]) -> Goal:
    least = _bound(table, "min", "rad")
    if not 0 < least < math.pi:
        raise DesignError("a phase margin lies between 0 and 180 deg", found=repr(table["min"]))
    return PhaseMargin(least=least, over=over)


def _gain_margin(table: Mapping[str, Any], over: Mapping[str, Range]) -> Goal:
    least = _bound(table, "min", "")
    if not least > 1:
        raise DesignError("a gain margin is a factor above 1", found=repr(table["min"]))
    return GainMargin(least=least, over=over)


def _modulus_margin(table: Mapping[str, Any], over: Mapping[str, Range]) -> Goal:
    least = _bound(table, "min", "")
    if not 0 < least < 1:
        raise DesignError("a modulus margin lies between 0 and 1", found=repr(table["min"]))
    return ModulusMargin(least=least, over=over)


_MAKERS: dict[str, Callable[[Mapping[str, Any], Mapping[str, Range]], Goal]] = {
    "band_error": _band_error,
    "noise_gain": _noise_gain,
    "phase_margin": _phase_margin,
    "gain_margin": _gain_margin,
    "modulus_margin": _modulus_margin,
}


def _bound(table: Mapping[str, Any], key: str, unit: str) -> float:
    if key not in table:
        raise DesignError(
            "missing required value", found=f"a {table['type']} without {key}", advice=f"give {key}"
        )
    return number(table[key], unit)


def _range(raw: Any, unit: str) -> Range:
    if not isinstance(raw, list) or len(raw) != 2:
        raise DesignError("a range has two ends", found=repr(raw), advice="write [low, high]")
    low, high = (number(item, unit) for item in raw)
    if not low < high:
        raise DesignError("a range runs from low to high", found=repr(raw))
    return low, high
