"""The [parameters] of a design: numbers, quantities in SI and formulas of each other, in any order."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Any, final

import numpy as np

from delaytools.blocks.block import Scalar
from delaytools.design.dimension import NONE, Powers, dimension_of
from delaytools.design.faults import Faults
from delaytools.signals.expression import Expression, check_name
from delaytools.signals.trouble import DesignError, shown
from delaytools.signals.units import quantity, unit

__all__ = ["Parameters", "check_names", "parameter", "read_parameters"]


@final
@dataclass(frozen=True)
class Parameters:
    """What values may be formulas of: name -> number or formula, and the dimension of each (missing: none)."""

    values: Mapping[str, Scalar] = field(default_factory=dict)
    dimensions: Mapping[str, Powers] = field(default_factory=dict)


def parameter(raw: Any, known: Collection[str]) -> Scalar:
    """A number: bare, a quantity in SI, or a formula of the names `known`."""
    if isinstance(raw, bool) or not isinstance(raw, int | float | str):
        raise DesignError(
            "a number is wanted here", found=shown(raw), advice='write 0.5, "5 ms" or a formula'
        )
    if isinstance(raw, int | float):
        if math.isnan(raw):
            raise DesignError("this is not a number", found="nan", advice="give a number")
        return float(raw)
    if (parts := quantity(raw)) is not None:
        return parts[0] * unit(parts[1]).scale
    formula = Expression(raw)
    check_names(formula, known)
    return formula


def check_names(formula: Expression, known: Collection[str]) -> None:
    """Raises DesignError for a name in a value that is no parameter."""
    for name in formula.names:
        if name not in known:
            raise DesignError(
                "unknown name in a value",
                found=repr(name),
                known=sorted(known),
                advice="a value is a number, a quantity with its unit, or a formula of [parameters]",
            )


def read_parameters(raw: Mapping[str, Any], faults: Faults) -> Parameters:
    """The table [parameters]; what is wrong in it goes to `faults`."""
    values: dict[str, Scalar] = {}
    before = len(faults.found)
    for name, item in raw.items():
        with faults.at(f"parameters.{name}"):
            check_name(name, "parameter")
            values[name] = parameter(item, raw)
    if len(faults.found) > before:
        return Parameters(values)
    with faults.at("parameters"):
        return Parameters(values, _dimensions(raw, values, faults))
    return Parameters(values)


def _dimensions(raw: Mapping[str, Any], values: Mapping[str, Scalar], faults: Faults) -> dict[str, Powers]:
    """The dimension of every parameter; every formula has a finite value, or it is a fault."""
    found: dict[str, Powers] = {}
    numbers: dict[str, float] = {}
    for name in _order(values):
        item = values[name]
        with faults.at(f"parameters.{name}"):
            if isinstance(item, Expression):
                found[name], numbers[name] = NONE, math.nan
                found[name] = dimension_of(item, found)
                numbers[name] = _finite(item, numbers)
            else:
                parts = quantity(raw[name]) if isinstance(raw[name], str) else None
                found[name], numbers[name] = unit(parts[1]).powers if parts else NONE, item
    return found


def _order(values: Mapping[str, Scalar]) -> tuple[str, ...]:
    graph = {name: v.names if isinstance(v, Expression) else () for name, v in values.items()}
    try:
        return tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        circle = " -> ".join(reversed(error.args[1]))
        raise DesignError(
            "parameters that depend on each other in a circle",
            found=circle,
            advice="give one of them as a number",
        ) from error


def _finite(formula: Expression, numbers: Mapping[str, float]) -> float:
    with np.errstate(all="ignore"):
        found = float(formula.evaluate(numbers))
    if not math.isfinite(found) and all(math.isfinite(numbers[name]) for name in formula.names):
        raise DesignError("a formula without a finite value", found=shown(formula.text))
    return found
