"""The table of an `equations` block as an element of the loop."""

from collections.abc import Collection, Mapping
from typing import Any

from delaytools.blocks.block import Scalar
from delaytools.blocks.equations import Equations
from delaytools.design.faults import Faults
from delaytools.design.parameters import Parameters, parameter
from delaytools.design.values import read_scalar
from delaytools.design.wiring import input_formula
from delaytools.loop.loop import Element
from delaytools.signals.expression import Expression, check_name, constant
from delaytools.signals.trouble import DesignError, shown
from delaytools.signals.units import Unit, unit

__all__ = ["make_equations"]

KEYS = ("inputs", "states", "parameters", "rates", "outputs")
NEEDED = ("inputs", "outputs")
_EXAMPLES = {
    "inputs": 'inputs = { u = "SIGNAL" }',
    "states": "states = { x = 0.0 }",
    "parameters": "parameters = { mass = 95.1 }",
    "rates": 'rates = { x = "u - x" }',
    "outputs": 'outputs = { SIGNAL = "x" }',
}


def make_equations(
    place: str, table: Mapping[str, Any], *, units: Mapping[str, str], parameters: Parameters
) -> Element:
    """The element; raises DesignError that names every fault found in the table."""
    tables = _tables(place, table)
    faults = Faults()
    own = [name for key in ("inputs", "states", "parameters") for name in tables[key]]
    known = sorted({*own, *parameters.values})
    rates = _formulas(tables["rates"], f"{place}.rates", known, faults)
    formulas = _formulas(tables["outputs"], f"{place}.outputs", known, faults)
    start: dict[str, Scalar] = {}
    for name, raw in tables["states"].items():
        with faults.at(f"{place}.states.{name}"):
            start[name] = read_scalar(raw, _state_unit(name, rates, formulas, units), parameters)
    values: dict[str, Scalar] = {}
    for name, raw in tables["parameters"].items():
        with faults.at(f"{place}.parameters.{name}"):
            values[name] = parameter(raw, parameters.values)
    inputs: dict[str, Expression] = {}
    for name, text in tables["inputs"].items():
        with faults.at(f"{place}.inputs.{name}"):
            inputs[name] = input_formula(text)
    _check_names(tables, place, faults)
    faults.settle()
    used = {name for formula in (*rates.values(), *formulas.values()) for name in formula.names}
    shared = {name: item for name, item in parameters.values.items() if name in used}
    try:
        block = Equations(
            input_names=tuple(inputs),
            start=start,
            parameters=values,
            rates=rates,
            formulas=formulas,
            shared=shared,
        )
    except DesignError as error:
        raise error.at(place) from error
    return Element(place.removeprefix("blocks."), block, inputs, {port: port for port in block.outputs})


def _tables(place: str, table: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    faults = Faults()
    for key in table:
        if key not in KEYS and key != "type":
            with faults.at(f"{place}.{key}"):
                raise DesignError("unknown value of an equations block", found=repr(key), known=KEYS)
    for key in KEYS:
        with faults.at(f"{place}.{key}"):
            if key in NEEDED and not table.get(key):
                raise DesignError("missing required value", advice=f"write {_EXAMPLES[key]}")
            if not isinstance(table.get(key, {}), Mapping):
                raise DesignError(
                    "names with their values are wanted here",
                    found=shown(table[key]),
                    advice=f"write {_EXAMPLES[key]}",
                )
    faults.settle()
    return {key: table.get(key, {}) for key in KEYS}


def _check_names(tables: Mapping[str, Mapping[str, Any]], place: str, faults: Faults) -> None:
    words = {"inputs": "input", "states": "state", "parameters": "parameter", "outputs": "signal"}
    for key, what in words.items():
        for name in tables[key]:
            with faults.at(f"{place}.{key}"):
                check_name(name, what)


def _formulas(
    table: Mapping[str, Any], place: str, known: Collection[str], faults: Faults
) -> dict[str, Expression]:
    found = {}
    for key, raw in table.items():
        with faults.at(f"{place}.{key}"):
            found[key] = _formula(raw)
            for name in found[key].names:
                if name not in known:
                    raise DesignError(
                        "unknown name in a formula",
                        found=repr(name),
                        known=known,
                        advice="signals enter an equations block through its inputs",
                    )
    return found


def _formula(raw: Any) -> Expression:
    if isinstance(raw, int | float) and not isinstance(raw, bool):
        return constant(raw)
    if not isinstance(raw, str):
        raise DesignError("a formula is wanted here", found=shown(raw), advice="write it in quotes")
    return Expression(raw)


def _state_unit(
    state: str,
    rates: Mapping[str, Expression],
    formulas: Mapping[str, Expression],
    units: Mapping[str, str],
) -> Unit | None:
    """The unit of a state that is an output, or the derivative of a state that is one (None: not known)."""
    for signal, formula in formulas.items():
        if formula.text.strip() == state:
            return unit(units.get(signal, ""))
    for other, rate in rates.items():
        if rate.text.strip() == state and other != state:
            for signal, formula in formulas.items():
                if formula.text.strip() == other:
                    return unit(units.get(signal, "")).per_second()
    return None
