"""An [[effects]] entry of type formula as its effect."""

from collections.abc import Mapping
from typing import Any

from delaytools.design.faults import Faults
from delaytools.design.parameters import Parameters, parameter
from delaytools.effects.formula import FormulaEffect
from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError, shown

__all__ = ["make_formula"]

KEYS = ("formula", "parameters", "neutral")
_EXAMPLE = 'write formula = "u + k*u*abs(u)", parameters = { k = 0.1 }, neutral = { k = 0.0 }'


def make_formula(table: Mapping[str, Any], parameters: Parameters) -> FormulaEffect:
    """The effect; raises DesignError that names every fault of the entry."""
    faults = Faults()
    for key in (key for key in table if key not in (*KEYS, "type", "at")):
        with faults.at(key):
            raise DesignError("unknown value", found=repr(key), known=KEYS)
    if not isinstance(table.get("formula"), str):
        with faults.at("formula"):
            raise DesignError("a formula is wanted here", found=shown(table.get("formula")), advice=_EXAMPLE)
    values = _numbers(table, "parameters", parameters, faults)
    neutral = _numbers(table, "neutral", Parameters(), faults)
    faults.settle()
    try:
        formula = Expression(table["formula"])
    except DesignError as error:
        raise error.at("formula") from error
    return FormulaEffect(formula=formula, parameters=values, neutral=neutral)


def _numbers(table: Mapping[str, Any], key: str, known: Parameters, faults: Faults) -> dict[str, Any]:
    found: dict[str, Any] = {}
    raw = table.get(key, {})
    if not isinstance(raw, Mapping):
        with faults.at(key):
            raise DesignError("names with their values are wanted here", found=shown(raw), advice=_EXAMPLE)
        return found
    for name, item in raw.items():
        with faults.at(f"{key}.{name}"):
            found[name] = parameter(item, known.values)
    return found
