"""One [[effects]] entry as Loop → Loop."""

from collections.abc import Mapping
from typing import Any

from delaytools.blocks.block import specifications
from delaytools.blocks.equations import Equations
from delaytools.design.catalogue import EFFECTS, PARAMETER_CHANGE
from delaytools.design.elements import read_values
from delaytools.design.values import Units, read_value
from delaytools.effects.effect import Effect, Place, check_place
from delaytools.effects.parameter_change import ParameterChange
from delaytools.loop.loop import Element, Loop
from delaytools.loop.port import Port, find_port
from delaytools.signals.trouble import DesignError
from delaytools.signals.units import Unit, unit

__all__ = ["apply_effect", "make_effect", "place_units"]


def apply_effect(loop: Loop, table: Mapping[str, Any], index: int, *, known: set[str]) -> Loop:
    """The loop with the entry's effect; raises DesignError for an unknown type, port, value or signal."""
    port = find_port(loop, table["at"])
    effect = make_effect(loop, table, port)
    place = Place(port, f"{table['type']}@{table['at']}", f"effects.{index}")
    check_place(effect, place)
    signals = {*loop.signals, *known}
    for name, spec in specifications(effect).items():
        signal = getattr(effect, name)
        if spec.unit == "name" and signal is not None and signal not in signals:
            raise DesignError("unknown signal", where=name, found=repr(signal), known=sorted(signals))
    return effect.apply(loop, place)


def make_effect(loop: Loop, table: Mapping[str, Any], port: Port) -> Effect:
    """The effect of an entry, with its values in the units of its place."""
    kind, _, what = str(table["type"]).partition(":")
    values = {key: raw for key, raw in table.items() if key not in ("type", "at")}
    if kind == PARAMETER_CHANGE:
        return _change(loop, port, what, values)
    if kind not in EFFECTS or what:
        names = [*sorted(EFFECTS), f"{PARAMETER_CHANGE}:NAME"]
        raise DesignError("unknown effect type", where="type", found=repr(table["type"]), known=names)
    units = place_units(loop, port)
    return EFFECTS[kind](**read_values(EFFECTS[kind], values, kind, units, loop.parameters))


def _change(loop: Loop, port: Port, name: str, values: Mapping[str, Any]) -> Effect:
    if set(values) - {name}:
        odd = sorted(set(values) - {name})[0]
        raise DesignError("unknown value", where=odd, known=[name], advice=f"give {name} = its new value")
    if name not in values:
        raise DesignError("missing required value", where=name, advice=f"give {name} = its new value")
    element = loop[port.element]
    spec = specifications(element.block).get(name.partition("[")[0])
    if spec is None and not isinstance(element.block, Equations):
        known = sorted(specifications(element.block))
        raise DesignError("unknown value of the block", where=port.element, found=repr(name), known=known)
    signal = loop.units.get(next(iter(element.outputs.values())), "")
    new = read_value(values[name], spec, Units(signal), loop.parameters) if spec else float(values[name])
    return ParameterChange(name=name, new=new)


def place_units(loop: Loop, port: Port) -> Units:
    """The units that "signal", "derivative" and "rate" stand for at a port."""
    element = loop[port.element]
    if port.kind == "input":
        names = [n for n in element.inputs[port.name].names if n not in loop.parameters]
        symbols = {loop.units.get(_source(loop, n), "") for n in names}
        return Units(symbols.pop() if len(symbols) == 1 else None)
    if port.kind == "output":
        return Units(loop.units.get(_final(loop, element.outputs[port.name]), ""))
    state = _state_unit(loop, element, port.name)
    if port.kind == "rate":
        out = loop.units.get(next(iter(element.outputs.values())), "")
        return Units(out, None, state)
    return Units(None, state.per_second() if state else None, state)


def _source(loop: Loop, signal: str) -> str:
    """The named signal that enters a chain of effects at an input."""
    while signal.endswith(".output") and "@" in signal:
        writer = next(e for e in loop.elements if signal in e.outputs.values())
        signal = next(iter(writer.inputs.values())).names[0]
    return signal


def _final(loop: Loop, signal: str) -> str:
    """The named signal that leaves a chain of effects at an output."""
    while signal.endswith(".input") and "@" in signal:
        follower = next(e for e in loop.elements if any(x.text == signal for x in e.inputs.values()))
        signal = follower.outputs["output"]
    return signal


def _state_unit(loop: Loop, element: Element, state: str) -> Unit | None:
    block = element.block
    if isinstance(block, Equations):
        for port, formula in block.formulas.items():
            if formula.text.strip() == state:
                return unit(loop.units.get(_final(loop, element.outputs[port]), ""))
        return None
    out = unit(loop.units.get(_final(loop, next(iter(element.outputs.values()))), ""))
    return out.per_second() if state == "rate" else out
