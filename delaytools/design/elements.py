"""One [blocks.NAME] table as an element of the loop."""

from collections.abc import Mapping
from typing import Any

from delaytools.blocks.block import Block, required, specifications
from delaytools.design.catalogue import BLOCKS
from delaytools.design.equations import make_equations
from delaytools.design.faults import Faults
from delaytools.design.parameters import Parameters
from delaytools.design.shapes import check_shape_of
from delaytools.design.values import Units, read_value
from delaytools.design.wiring import check_block_name, input_formula, port_names, ported
from delaytools.loop.loop import Element
from delaytools.signals.expression import check_name
from delaytools.signals.trouble import DesignError, shown

__all__ = ["make_element", "read_values"]

WIRING = ("type", "input", "inputs", "output", "outputs")


def make_element(
    name: str, table: Mapping[str, Any], *, units: Mapping[str, str], parameters: Parameters
) -> Element:
    """The element that a block's table describes; raises DesignError that names every fault found in it."""
    place, kind = f"blocks.{name}", table["type"]
    check_block_name(name)
    if kind not in BLOCKS and kind != "equations":
        known = sorted([*BLOCKS, "equations"])
        raise DesignError("unknown block type", where=f"{place}.type", found=shown(kind), known=known)
    if kind == "equations":
        return make_equations(place, table, units=units, parameters=parameters)
    faults = Faults()
    inputs, outputs, block = None, None, None
    with faults.at(""):
        inputs = port_names(table, "input", place)
    with faults.at(""):
        outputs = port_names(table, "output", place)
    with faults.at(""):
        values = {key: raw for key, raw in table.items() if key not in WIRING}
        held_in = Units(_unit_of(outputs, units))
        block = _built(
            BLOCKS[kind], read_values(BLOCKS[kind], values, place, held_in, parameters), f"{place}"
        )
    faults.settle()
    assert inputs is not None and outputs is not None and block is not None
    return _wired(name, block, inputs, outputs)


def _unit_of(outputs: Any, units: Mapping[str, str]) -> str:
    names = list(outputs.values()) if isinstance(outputs, dict) else outputs or []
    return units.get(names[0], "") if names and isinstance(names[0], str) else ""


def _built(kind: type[Block], values: Mapping[str, Any], place: str) -> Block:
    try:
        return kind(**values)
    except DesignError as error:
        raise error.at(place) from error
    except (TypeError, ValueError, IndexError) as error:
        raise DesignError(
            "these values do not fit together", where=place, found=shown(dict(values))
        ) from error


def _wired(name: str, block: Block, inputs: Any, outputs: Any) -> Element:
    faults, place = Faults(), f"blocks.{name}"
    wired: dict[str, Any] = {}
    written: dict[str, str] = {}
    with faults.at(f"{place}.input"):
        for port, text in ported(inputs, block.inputs).items():
            with faults.at(f"{place}.{port}"):
                wired[port] = input_formula(text)
    with faults.at(f"{place}.output"):
        written = ported(outputs, block.outputs)
        for signal in written.values():
            check_name(signal, "signal")
    faults.settle()
    return Element(name, block, wired, written)


def read_values(
    kind: type, values: Mapping[str, Any], place: str, units: Units, parameters: Parameters
) -> dict[str, Any]:
    """The values of a block or effect as its class takes them; raises DesignError that names every fault."""
    specs = specifications(kind)
    faults = Faults()
    for key in values:
        if key not in specs:
            with faults.at(f"{place}.{key}"):
                raise DesignError("unknown value", found=repr(key), known=sorted(specs) or ["none"])
    for key in required(kind):
        if key not in values:
            unit = specs[key].unit
            hint = f" (in {unit})" if unit not in ("", "name", "signal", "derivative", "rate") else ""
            with faults.at(f"{place}.{key}"):
                raise DesignError("missing required value", advice=f"give {key}{hint}")
    found = {}
    for key in (key for key in values if key in specs):
        with faults.at(f"{place}.{key}"):
            found[key] = _value(kind, key, values[key], units, parameters)
    faults.settle()
    return found


def _value(kind: type, key: str, raw: Any, units: Units, parameters: Parameters) -> Any:
    spec = specifications(kind)[key]
    if spec.unit == "name":
        if not isinstance(raw, str):
            raise DesignError("the name of a signal is wanted here", found=shown(raw))
        return raw
    if spec.many:
        check_shape_of(kind, key, raw)
    return read_value(raw, spec, units, parameters)
