"""What a design says is not known exactly: [tolerance] as parameters with bounds."""

from typing import Any

from delaytools.design.design import Design
from delaytools.design.wishes import unit_at
from delaytools.loop.loop import Loop
from delaytools.loop.values import value_paths
from delaytools.signals.parameter import Parameter
from delaytools.signals.units import convert, quantity

__all__ = ["tolerances"]


def tolerances(design: Design, loop: Loop) -> tuple[Parameter, ...]:
    """Every value that is free within a tolerance, with its bounds in the value's own unit.

    "6 %" is a share of the nominal value; a quantity or a bare number is absolute.
    """
    known = value_paths(loop)
    found = []
    for path, raw in design.tables.tolerance.items():
        full = path if path in known else f"parameters.{path}"
        value = known[full]
        reach = _reach(raw, value, getattr(unit_at(loop, full), "symbol", ""))
        found.append(Parameter(full, value, low=value - reach, high=value + reach))
    return tuple(found)


def _reach(raw: Any, value: float, held_in: str) -> float:
    if not isinstance(raw, str):
        return float(raw)
    parts = quantity(raw)
    assert parts is not None  # checked with the design
    if parts[1] == "%":
        return abs(value) * parts[0] / 100
    return float(convert(parts[0], parts[1], held_in)) if held_in else parts[0]
