"""Numbers as a design file writes them: bare, with a unit, or as a formula of [parameters]."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, final

from delaytools.blocks.block import Scalar, Specification
from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError, UnitError
from delaytools.signals.units import Unit, convert, quantity, unit

__all__ = ["Units", "number", "parameter", "read_value"]


@final
@dataclass(frozen=True)
class Units:
    """The units that "signal", "signal/s", "derivative" and "rate" stand for at a place (None: not known)."""

    signal: str | None = None
    derivative: Unit | None = None
    rate: Unit | None = None

    def resolve(self, name: str) -> Unit | None:
        """The unit in which a value is held; None where only bare numbers make sense."""
        if name == "signal":
            return unit(self.signal) if self.signal is not None else None
        if name == "signal/s":
            return unit(self.signal).per_second() if self.signal is not None else None
        if name == "derivative":
            return self.derivative
        if name == "rate":
            return self.rate
        if name == "1/s":
            return unit("").per_second()
        return unit(name)


def read_value(raw: Any, spec: Specification, units: Units, parameters: Collection[str]) -> Scalar:
    """A float in the place's unit, a formula of [parameters], or (nested) tuples of them.

    Raises DesignError or UnitError that says what was found and what is wanted.
    """
    if isinstance(raw, list):
        if not spec.many:
            raise DesignError("one number is wanted here", found=repr(raw))
        return tuple(read_value(item, spec, units, parameters) for item in raw)
    found = _scalar(raw, spec.unit, units, parameters)
    if isinstance(found, float) and not spec.allows(found):
        low, high = ("(", ")") if spec.exclusive else ("[", "]")
        raise DesignError(
            "value outside its bounds",
            found=f"{raw!r}",
            advice=f"allowed: {low}{spec.low:g}, {spec.high:g}{high}",
        )
    return found


def _scalar(raw: Any, unit_name: str, units: Units, parameters: Collection[str]) -> Scalar:
    if isinstance(raw, bool) or not isinstance(raw, int | float | str):
        raise DesignError("a number is wanted here", found=repr(raw), advice='write 0.5, "5 ms" or a formula')
    if isinstance(raw, int | float):
        return float(raw)
    parts = quantity(raw)
    if parts is not None:
        return _converted(parts, units.resolve(unit_name))
    expression = Expression(raw)
    for name in expression.names:
        if name not in parameters:
            raise DesignError(
                "unknown name in a value",
                found=repr(name),
                known=sorted(parameters),
                advice="a value is a number, a quantity with its unit, or a formula of [parameters]",
            )
    return expression


def _converted(parts: tuple[float, str], target: Unit | None) -> float:
    amount, symbol = parts
    if symbol == "" or math.isinf(amount):
        return amount
    if target is None:
        raise UnitError(
            "the unit of this place is not declared",
            found=repr(symbol),
            advice="give a bare number, or the signal's unit",
        )
    if symbol == "%" and not any(target.powers):
        return amount / 100
    return convert(amount, symbol, target)


def number(raw: Any, unit_name: str, *, signal: str | None = None) -> float:
    """A plain number in `unit_name`, from a bare number or a quantity."""
    found = _scalar(raw, unit_name, Units(signal), ())
    assert isinstance(found, float)
    return found


def parameter(raw: Any, parameters: Collection[str]) -> Scalar:
    """A number of [parameters]: bare, a quantity in SI, or a formula of other parameters."""
    if isinstance(raw, str) and (parts := quantity(raw)) is not None:
        amount, symbol = parts
        return amount * unit(symbol).scale
    return _scalar(raw, "", Units(), parameters)
