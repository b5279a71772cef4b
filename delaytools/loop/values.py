"""The numbers of a loop: every value by its path, resolved from [parameters], some of them left free."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from delaytools.blocks.block import CASADI, Scalar, flat_values, specifications, with_values
from delaytools.blocks.equations import Equations
from delaytools.loop.edit import wire
from delaytools.loop.loop import Element, Loop
from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError

__all__ = ["parameter_values", "resolve", "value_paths", "with_numbers"]


def value_paths(loop: Loop) -> dict[str, float]:
    """Every number that can be moved, by path (`parameters.kp`, `actuator.damping`, `effects.0.delay`)."""
    named = parameter_values(loop, {})
    found = {parameter_path(name): float(number) for name, number in named.items()}
    for element in loop.elements:
        homes = [(element.path, element.block), *((p.path, p.modifier) for p in element.modifiers)]
        for path, home in homes:
            for name, raw in flat_values(home).items():
                found[f"{path}.{name}"] = float(raw.evaluate(named, CASADI) if isinstance(raw, Expression) else raw)
    return found


def parameter_path(name: str) -> str:
    """The path of a named number; one that an effect brought keeps the effect's own path (`effects.0.damping`)."""
    return name if "." in name else f"parameters.{name}"


def with_numbers(loop: Loop, numbers: Mapping[str, float]) -> Loop:
    """The loop with other numbers at these paths; raises DesignError for a path that is not there."""
    known = value_paths(loop)
    for path in numbers:
        if path not in known:
            raise DesignError("no such value in the design", found=repr(path), known=sorted(known))
    parameters = {name: numbers.get(parameter_path(name), raw) for name, raw in loop.parameters.items()}
    elements = tuple(_with_numbers(element, numbers) for element in loop.elements)
    return replace(loop, elements=elements, parameters=parameters)


def _with_numbers(element: Element, numbers: Mapping[str, float]) -> Element:
    block = _renumbered(element.block, element.path, numbers)
    modifiers = tuple(replace(p, modifier=_renumbered(p.modifier, p.path, numbers)) for p in element.modifiers)
    return replace(element, block=block, modifiers=modifiers)


def _renumbered(item: Any, path: str, numbers: Mapping[str, float]) -> Any:
    new = {name: numbers[f"{path}.{name}"] for name in flat_values(item) if f"{path}.{name}" in numbers}
    return with_values(item, new) if new else item


def parameter_values(loop: Loop, free: Mapping[str, Scalar]) -> dict[str, Scalar]:
    """[parameters] by name, resolved in whatever order they refer to each other."""
    done: dict[str, Scalar] = {}
    waiting = dict(loop.parameters)
    for name in list(waiting):
        if parameter_path(name) in free:
            done[name] = free[parameter_path(name)]
            del waiting[name]
    while waiting:
        ready = [n for n, v in waiting.items() if not isinstance(v, Expression) or set(v.names) <= set(done)]
        if not ready:
            stuck = {n: [m for m in v.names if m not in done] for n, v in waiting.items()}
            name, missing = next(iter(stuck.items()))
            raise DesignError(
                "a parameter needs a name that is not known or that depends on it",
                where=f"parameters.{name}",
                found=", ".join(missing),
                known=sorted(loop.parameters),
            )
        for name in ready:
            item = waiting.pop(name)
            done[name] = item.evaluate(done, CASADI) if isinstance(item, Expression) else item
    return done


def resolve(loop: Loop, free: Mapping[str, Scalar] | None = None) -> Loop:
    """The loop with every value a number, or the symbol that `free` gives for its path.

    Blocks and effects at their neutral value are replaced by wires, unless one of their values is free.
    Raises DesignError for a path that is not there, or for a value outside its bounds.
    """
    free = free or {}
    named = parameter_values(loop, free)
    used: set[str] = {parameter_path(name) for name in named}
    elements = tuple(_resolved(element, named, free, used) for element in loop.elements)
    unknown = sorted(set(free) - used)
    if unknown:
        raise DesignError("no such value in the design", found=repr(unknown[0]), known=sorted(used))
    return replace(loop, elements=elements, parameters=named)


def _resolved(
    element: Element, named: Mapping[str, Scalar], free: Mapping[str, Scalar], used: set[str]
) -> Element:
    block = _numbers(element.block, element.path, named, free, used)
    if isinstance(block, Equations):
        block = _shared(block, named)
    kept = []
    for placed in element.modifiers:
        modifier = _numbers(placed.modifier, placed.path, named, free, used)
        if not is_neutral(modifier):
            kept.append(replace(placed, modifier=modifier))
    element = replace(element, block=block, modifiers=tuple(kept))
    if is_neutral(block):
        return wire(element)
    return element


def _shared(block: Equations, named: Mapping[str, Scalar]) -> Equations:
    return Equations(
        input_names=block.input_names,
        start=block.start,
        parameters=block.parameters,
        rates=block.rates,
        formulas=block.formulas,
        shared={name: named[name] for name in block.shared},
    )


def _numbers(
    item: Any, path: str, named: Mapping[str, Scalar], free: Mapping[str, Scalar], used: set[str]
) -> Any:
    new: dict[str, Scalar] = {}
    for name, raw in flat_values(item).items():
        place = f"{path}.{name}"
        used.add(place)
        number = free.get(place, raw.evaluate(named, CASADI) if isinstance(raw, Expression) else raw)
        spec = specifications(item).get(name.split("[")[0])
        if spec and isinstance(number, int | float) and not spec.allows(number):
            bounds = (
                f"{'(' if spec.exclusive else '['}{spec.low:g}, {spec.high:g}{')' if spec.exclusive else ']'}"
            )
            raise DesignError(
                "value outside its bounds", where=place, found=f"{number:g}", advice=f"allowed: {bounds}"
            )
        new[name] = number
    return with_values(item, new)


def is_neutral(item: Any) -> bool:
    """Whether every value that has a neutral value is at it; a formula brings its own neutral values."""
    own = getattr(item, "neutral", None)
    if own:
        numbers = flat_values(item)
        return all(isinstance(numbers[n], int | float) and numbers[n] == number for n, number in own.items())
    specs = {n: s for n, s in specifications(item).items() if s.neutral is not None}
    if not specs:
        return False
    return all(
        isinstance(getattr(item, n), int | float) and getattr(item, n) == s.neutral for n, s in specs.items()
    )
