"""One [[effects]] entry as Loop → Loop."""

from collections.abc import Collection, Mapping
from typing import Any

from delaytools.blocks.block import specifications
from delaytools.blocks.equations import Equations
from delaytools.design.catalogue import EFFECTS, PARAMETER_CHANGE
from delaytools.design.elements import read_values
from delaytools.design.formulas import make_formula
from delaytools.design.parameters import Parameters, parameter
from delaytools.design.values import Units, read_value
from delaytools.effects.effect import Effect, Place, check_place
from delaytools.effects.formula import FormulaEffect
from delaytools.effects.parameter_change import ParameterChange
from delaytools.loop.loop import Element, Loop
from delaytools.loop.port import Port, find_port, first_unit, read_at, written_at, written_behind
from delaytools.signals.trouble import DelaytoolsError, DesignError, shown
from delaytools.signals.units import Unit, unit

__all__ = ["apply_effect", "check_type", "make_effect", "place_units"]


def apply_effect(
    loop: Loop, table: Mapping[str, Any], path: str, *, known: Collection[str], parameters: Parameters
) -> Loop:
    """The loop with the entry's effect, whose values stand at `path` (`effects.0`).

    known: signals that are declared, beside those of the loop. Raises DesignError for an unknown type, port, value
    or signal.
    """
    kind, _, what = str(table["type"]).partition(":")
    check_type(table["type"])
    try:
        port = find_port(loop, table["at"])
    except DesignError as error:
        raise error.at("at") from error
    effect = _change(loop, port, what, table) if kind == PARAMETER_CHANGE else None
    effect = effect or make_effect(loop, table, port, parameters)
    place = Place(port, f"{table['type']}@{table['at']}", path)
    check_place(effect, place)
    signals = {*loop.signals, *known}
    for name, spec in specifications(effect).items():
        signal = getattr(effect, name)
        if spec.unit == "name" and signal is not None and signal not in signals:
            raise DesignError("unknown signal", where=name, found=repr(signal), known=sorted(signals))
    if isinstance(effect, FormulaEffect):
        _check_signals(effect.signals(loop, port), signals)
    return effect.apply(loop, place)


def _check_signals(names: Collection[str], known: Collection[str]) -> None:
    for name in names:
        if name not in known:
            advice = "a formula reads its own parameters, t, u, and signals by name; x, v and states on a derivative"
            raise DesignError(
                "unknown name in a formula", where="formula", found=repr(name), known=sorted(known), advice=advice
            )


def check_type(found: Any) -> None:
    """Raises DesignError for a type that is no effect of the catalogue."""
    kind, _, what = str(found).partition(":")
    names = [*sorted(EFFECTS), f"{PARAMETER_CHANGE}:NAME"]
    if kind == PARAMETER_CHANGE and not what:
        advice = f'write type = "{PARAMETER_CHANGE}:damping" for a value named damping'
        raise DesignError(
            "which value of the block changes?", where="type", found=shown(found), advice=advice
        )
    if kind != PARAMETER_CHANGE and (kind not in EFFECTS or what):
        raise DesignError("unknown effect type", where="type", found=shown(found), known=names)


def make_effect(loop: Loop, table: Mapping[str, Any], port: Port, parameters: Parameters) -> Effect:
    """The effect of an entry of the catalogue, with its values in the units of its place."""
    if table["type"] == FormulaEffect.kind:
        return make_formula(table, parameters)
    kind = EFFECTS[table["type"]]
    values = {key: raw for key, raw in table.items() if key not in ("type", "at")}
    return kind(**read_values(kind, values, kind.kind, place_units(loop, port), parameters))


def _change(loop: Loop, port: Port, name: str, table: Mapping[str, Any]) -> Effect:
    odd = sorted(set(table) - {name, "type", "at"})
    if odd:
        raise DesignError("unknown value", where=odd[0], known=[name], advice=f"give {name} = its new value")
    if name not in table:
        raise DesignError("missing required value", where=name, advice=f"give {name} = its new value")
    element = loop[port.element]
    spec = specifications(element.block).get(name.partition("[")[0])
    if spec is None and not isinstance(element.block, Equations):
        known = sorted(specifications(element.block))
        raise DesignError("unknown value of the block", where=port.element, found=repr(name), known=known)
    signal = first_unit(loop, element)
    try:
        if spec is None:
            return ParameterChange(name=name, new=parameter(table[name], loop.parameters))
        known_names = Parameters(loop.parameters)
        return ParameterChange(name=name, new=read_value(table[name], spec, Units(signal), known_names))
    except DelaytoolsError as error:
        raise error.at(name) from error


def place_units(loop: Loop, port: Port) -> Units:
    """The units that "signal", "derivative" and "rate" stand for at a port."""
    element = loop[port.element]
    if port.kind == "input":
        symbols = {loop.units.get(n, "") for n in read_at(loop, port).names if n not in loop.parameters}
        return Units(symbols.pop() if len(symbols) == 1 else None)
    if port.kind == "output":
        return Units(loop.units.get(written_at(loop, port), ""))
    state = _state_unit(loop, element, port.name)
    if port.kind == "rate":
        return Units(first_unit(loop, element), None, state)
    return Units(None, state.per_second() if state else None, state)


def _state_unit(loop: Loop, element: Element, state: str) -> Unit | None:
    block = element.block
    if isinstance(block, Equations):
        for port, formula in block.formulas.items():
            if formula.text.strip() == state:
                return unit(loop.units.get(written_behind(loop, element.outputs[port]), ""))
        return None
    out = unit(first_unit(loop, element))
    return out.per_second() if state == "rate" else out
