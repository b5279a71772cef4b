"""Fitted values as quantities: their units, and standard errors with the numerical error folded in."""

import math

from delaytools.blocks.block import specifications
from delaytools.design.catalogue import EFFECTS
from delaytools.design.entries import place_units
from delaytools.diagnosis.added import Added, path_of
from delaytools.diagnosis.answer import Quantity
from delaytools.diagnosis.fitting import Fitted
from delaytools.loop.loop import Loop
from delaytools.loop.port import find_port
from delaytools.loop.values import value_paths

__all__ = ["quantities"]

NUMERICAL = 1e-3  # of a value's distance from neutral: error of the simulation and of joining rows
PLACED = {"phase": 1.0, "start": 0.0, "end": 0.0}  # where something lies, not how large it is: of what, then


def quantities(loop: Loop, fitted: Fitted, place: int) -> dict[str, Quantity]:
    """The reported values of the effect number `place` of a hypothesis."""
    one = fitted.added[place]
    stds = {p.path: p.std for p in fitted.parameters}
    found = {}
    for name in one.reported:
        value = one.values[name]
        std = one.errors.get(name, stds.get(path_of(place, name), math.nan))
        found[name] = Quantity(value, _std(loop, one, name, std), _unit(loop, one, name))
    return found


def _std(loop: Loop, one: Added, name: str, std: float) -> float:
    neutral = neutral_value(loop, one, name)
    away = abs(one.values[name] - neutral) if math.isfinite(neutral) else abs(one.values[name])
    away = PLACED.get(name, away)
    return math.hypot(0.0 if math.isnan(std) else std, NUMERICAL * away)


def neutral_value(loop: Loop, one: Added, name: str) -> float:
    """The value at which nothing changes: the effect's neutral value, or what the design says of a block's value."""
    if ":" in one.kind:
        from_design = value_of(loop, one.at, name)
        return 0.0 if from_design is None else from_design
    neutral = specifications(EFFECTS[one.kind])[name].neutral
    return 0.0 if neutral is None or math.isinf(neutral) else neutral


def value_of(loop: Loop, block: str, name: str) -> float | None:
    """A number of a block as the design has it."""
    return value_paths(loop).get(f"{loop[block].path}.{name}")


def _unit(loop: Loop, one: Added, name: str) -> str:
    port = find_port(loop, one.at)
    spec = one.specification(loop, name)
    found = place_units(loop, port).resolve(spec.unit) if port.kind != "block" else _block_unit(spec.unit)
    return getattr(found, "symbol", "") or "" if not isinstance(found, str) else found


def _block_unit(unit: str) -> str:
    return "" if unit in ("signal", "derivative", "rate", "signal/s", "name") else unit
