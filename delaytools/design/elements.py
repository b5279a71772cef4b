"""One [blocks.NAME] table as an element of the loop."""

from collections.abc import Mapping
from typing import Any

from delaytools.blocks.block import Block, Specification, required, specifications
from delaytools.blocks.equations import Equations
from delaytools.design.catalogue import BLOCKS
from delaytools.design.values import Units, parameter, read_value
from delaytools.loop.loop import Element
from delaytools.signals.expression import Expression, constant
from delaytools.signals.trouble import DelaytoolsError, DesignError, nearest

__all__ = ["make_element", "read_values"]

WIRING = ("type", "input", "inputs", "output", "outputs")


def make_element(
    name: str, table: Mapping[str, Any], *, units: Mapping[str, str], parameters: Mapping[str, Any]
) -> Element:
    """The element that a block's table describes; raises DesignError for what is unknown or missing."""
    kind = table["type"]
    if kind not in BLOCKS and kind != "equations":
        raise DesignError(
            "unknown block type", where=f"blocks.{name}.type", found=repr(kind), known=sorted(BLOCKS)
        )
    if kind == "equations":
        return _equations(name, table, parameters)
    outputs = _names(table, "output", f"blocks.{name}")
    unit = units.get(next(iter(outputs.values())) if isinstance(outputs, dict) else outputs[0], "")
    values = {key: raw for key, raw in table.items() if key not in WIRING}
    block = BLOCKS[kind](**read_values(BLOCKS[kind], values, f"blocks.{name}", Units(unit), parameters))
    return Element(
        name,
        block,
        _inputs(table, block, name, parameters),
        _ported(outputs, block.outputs, f"blocks.{name}.output"),
    )


def read_values(
    kind: type, values: Mapping[str, Any], place: str, units: Units, parameters: Mapping[str, Any]
) -> dict[str, Any]:
    """The values of a block or effect as its class takes them; raises DesignError naming the place."""
    specs = specifications(kind)
    for key in values:
        if key not in specs:
            close = nearest(key, specs)
            advice = f"nearest: {close}" if close else ""
            raise DesignError(
                "unknown value", where=f"{place}.{key}", known=sorted(specs) or ["none"], advice=advice
            )
    for key in required(kind):
        if key not in values:
            unit = specs[key].unit
            hint = f" (in {unit})" if unit not in ("", "name") else ""
            raise DesignError("missing required value", where=f"{place}.{key}", advice=f"give {key}{hint}")
    return {key: _value(raw, specs[key], f"{place}.{key}", units, parameters) for key, raw in values.items()}


def _value(raw: Any, spec: Specification, place: str, units: Units, parameters: Mapping[str, Any]) -> Any:
    if spec.unit == "name":
        if not isinstance(raw, str):
            raise DesignError("the name of a signal is wanted here", where=place, found=repr(raw))
        return raw
    try:
        return read_value(raw, spec, units, parameters)
    except DelaytoolsError as error:
        raise error.at(place) from error


def _names(table: Mapping[str, Any], key: str, place: str) -> Any:
    """The wiring under `input`/`inputs` (or output): a dictionary by port, or a list in port order."""
    plural = f"{key}s"
    if key in table and plural in table:
        raise DesignError(f"both {key} and {plural}", where=place, advice="give one of them")
    found = table.get(key, table.get(plural))
    if found is None:
        raise DesignError("missing required value", where=f"{place}.{key}", advice=f"give {key}")
    wired = [found] if isinstance(found, str) else found
    if not isinstance(wired, list | dict) or not wired:
        raise DesignError(
            "a signal name or a list of them is wanted", where=f"{place}.{key}", found=repr(found)
        )
    return wired


def _ported(wired: Any, ports: tuple[str, ...], place: str) -> dict[str, str]:
    if isinstance(wired, list):
        if len(wired) != len(ports):
            raise DesignError(
                "wrong number of signals",
                where=place,
                found=f"{len(wired)}",
                known=ports,
                advice=f"give {len(ports)}",
            )
        wired = dict(zip(ports, wired, strict=True))
    for port, text in wired.items():
        if port not in ports:
            raise DesignError("unknown port", where=place, found=repr(port), known=ports)
        if not isinstance(text, str):
            raise DesignError("a signal name is wanted", where=place, found=repr(text))
    for port in ports:
        if port not in wired:
            raise DesignError("a port without a signal", where=place, found=port, advice=f"wire {port}")
    return dict(wired)


def _inputs(
    table: Mapping[str, Any], block: Block, name: str, parameters: Mapping[str, Any]
) -> dict[str, Expression]:
    place = f"blocks.{name}.input"
    wired = _ported(_names(table, "input", f"blocks.{name}"), block.inputs, place)
    return {port: combination(text, place) for port, text in wired.items()}


def combination(text: str, place: str) -> Expression:
    """A signal or a linear combination of signals."""
    try:
        return Expression(text)
    except DesignError as error:
        raise error.at(place) from error


def _equations(name: str, table: Mapping[str, Any], parameters: Mapping[str, Any]) -> Element:
    place = f"blocks.{name}"
    known = ("type", "inputs", "states", "parameters", "rates", "outputs")
    for key in table:
        if key not in known:
            raise DesignError("unknown value", where=f"{place}.{key}", known=known[1:])
    for key in ("inputs", "outputs"):
        if not isinstance(table.get(key), Mapping):
            raise DesignError(
                "missing required value",
                where=f"{place}.{key}",
                advice=f"give {key} = {{ name = ... }} of an equations block",
            )
    rates = _formulas(table.get("rates", {}), f"{place}.rates")
    formulas = _formulas(table["outputs"], f"{place}.outputs")
    used = {n for formula in (*rates.values(), *formulas.values()) for n in formula.names}
    try:
        block = Equations(
            input_names=tuple(table["inputs"]),
            start={key: parameter(raw, parameters) for key, raw in table.get("states", {}).items()},
            parameters={key: parameter(raw, parameters) for key, raw in table.get("parameters", {}).items()},
            rates=rates,
            formulas=formulas,
            shared={n: parameters[n] for n in parameters if n in used},
        )
    except DesignError as error:
        raise error.at(place) from error
    wired = {port: combination(text, f"{place}.inputs.{port}") for port, text in table["inputs"].items()}
    return Element(name, block, wired, {port: port for port in block.outputs})


def _formulas(table: Mapping[str, Any], place: str) -> dict[str, Expression]:
    found = {}
    for key, raw in table.items():
        found[key] = (
            constant(raw) if isinstance(raw, int | float) else combination(str(raw), f"{place}.{key}")
        )
    return found
