"""Design → Loop: blocks in their places, effects in file order, one configuration, or the loop that flies."""

import math
from collections.abc import Mapping
from typing import Any

from delaytools.design.configurations import configured, effect_places, override
from delaytools.design.connections import check_connections
from delaytools.design.design import Design
from delaytools.design.elements import make_element
from delaytools.design.entries import apply_effect, check_type
from delaytools.design.faults import Faults
from delaytools.design.parameters import Parameters, read_parameters
from delaytools.design.values import number
from delaytools.design.wishes import check_paths, warnings
from delaytools.loop.edit import remove
from delaytools.loop.loop import Element, Loop
from delaytools.loop.network import network
from delaytools.loop.values import resolve
from delaytools.signals.trouble import DelaytoolsError, DesignError, shown
from delaytools.signals.units import unit

__all__ = ["build", "check_paths", "configured", "flight", "override", "warnings"]


def build(design: Design, configuration: str | None = None) -> Loop:
    """The loop of a design, in one configuration; raises DesignError that names every fault found."""
    try:
        data = configured(design, configuration)
    except DelaytoolsError as error:
        raise error.at(design.name) from error
    faults = Faults(design.name)
    parameters = read_parameters(data.get("parameters", {}), faults)
    units = _units(data, faults)
    frame = _frame(data, parameters, faults)
    faults.settle()
    elements = _elements(data, units, parameters, faults)
    loop = Loop(tuple(elements), parameters.values, units, frame, design.title)
    check_connections(loop, data, faults, whole=not faults.found)
    loop = _with_effects(loop, data, parameters, effect_places(design, configuration), faults)
    faults.settle()
    with faults.at(""):
        network(resolve(loop))
    faults.settle()
    return loop


def _units(data: Mapping[str, Any], faults: Faults) -> dict[str, str]:
    for name, symbol in data.get("signals", {}).items():
        with faults.at(f"signals.{name}"):
            unit(symbol)
    return dict(data.get("signals", {}))


def _frame(data: Mapping[str, Any], parameters: Parameters, faults: Faults) -> float:
    raw = data.get("frame", 1e-3)
    if faults.found:
        parameters = Parameters()
    with faults.at("frame"):
        frame = number(raw, "s", parameters=parameters)
        if not 0 < frame < math.inf:
            raise DesignError("the frame is above 0 s", found=shown(raw), advice='write frame = "1 ms"')
        return frame
    return 1e-3


def _elements(
    data: Mapping[str, Any], units: Mapping[str, str], parameters: Parameters, faults: Faults
) -> list[Element]:
    blocks = data.get("blocks", {})
    if not blocks:
        with faults.at(""):
            raise DesignError("a design without blocks", advice="write at least one table [blocks.NAME]")
    elements = []
    for name, table in blocks.items():
        with faults.at(""):
            elements.append(make_element(name, table, units=units, parameters=parameters))
    return elements


def _with_effects(
    loop: Loop, data: Mapping[str, Any], parameters: Parameters, places: list[str], faults: Faults
) -> Loop:
    """The loop with its effects; where a block has faults of its own, nothing is said of effects at it."""
    made = {element.name for element in loop.elements}
    known = set(loop.units) | set(data.get("inputs", {}))
    faulty = bool(faults.found)
    for index, table in enumerate(data.get("effects", [])):
        host = table["at"].partition(".")[0]
        if faulty and host in data.get("blocks", {}) and host not in made:
            with faults.at(places[index]):
                check_type(table["type"])
            continue
        with faults.at(places[index]):
            loop = apply_effect(loop, table, f"effects.{index}", known=known, parameters=parameters)
    return loop


def flight(design: Design, configuration: str | None = None) -> Loop:
    """The loop that flies: the blocks and effects of [flight] taken out, with the effects at those blocks' ports."""
    loop = build(design, configuration)
    everywhere = _all_effects(design)
    faults = Faults(design.name)
    for index, name in enumerate(design.tables.flight.remove):
        with faults.at(f"flight.remove.{index}"):
            loop = _without(loop, name, everywhere)
    faults.settle()
    return loop


def _without(loop: Loop, name: str, everywhere: set[str]) -> Loop:
    if "@" in name:
        if not _has(loop, name) and name not in everywhere:
            advice = "" if everywhere else "the design has no effects"
            raise DesignError("unknown effect", found=repr(name), known=sorted(everywhere), advice=advice)
        return remove(loop, name) if _has(loop, name) else loop
    attached = [n for n in _effects_in(loop) if n.partition("@")[2].partition(".")[0] == name]
    loop = remove(loop, name)
    for effect in attached:
        loop = remove(loop, effect) if _has(loop, effect) else loop
    return loop


def _effects_in(loop: Loop) -> list[str]:
    inserted = [e.name for e in loop.elements if "@" in e.name]
    return inserted + [p.name for e in loop.elements for p in e.modifiers]


def _has(loop: Loop, name: str) -> bool:
    return name in _effects_in(loop)


def _all_effects(design: Design) -> set[str]:
    tables = [*design.tables.effects, *(e for c in design.tables.configurations.values() for e in c.effects)]
    return {f"{table.type}@{table.at}" for table in tables}
