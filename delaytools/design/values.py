"""Numbers as a design file writes them: bare, with a unit, or as a formula of [parameters]."""

import math
from dataclasses import dataclass
from typing import Any, final

from delaytools.blocks.block import CASADI, Scalar, Specification
from delaytools.design.dimension import in_unit
from delaytools.design.parameters import Parameters, check_names
from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError, UnitError, shown
from delaytools.signals.units import Unit, convert, quantity, unit

__all__ = ["Units", "bounds_in_words", "number", "read_scalar", "read_value"]


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


def read_value(raw: Any, spec: Specification, units: Units, parameters: Parameters) -> Scalar:
    """A float in the place's unit, a formula of [parameters], or (nested) tuples of them.

    Raises DesignError or UnitError that says what was found and what is wanted.
    """
    if isinstance(raw, list):
        if not spec.many:
            raise DesignError("one number is wanted here", found=shown(raw))
        return tuple(read_value(item, spec, units, parameters) for item in raw)
    found = read_scalar(raw, units.resolve(spec.unit), parameters)
    if isinstance(found, float):
        _check_bounds(found, raw, spec)
    return found


def _check_bounds(found: float, raw: Any, spec: Specification) -> None:
    if not spec.allows(found):
        raise DesignError(
            "value outside its bounds", found=shown(raw), advice=f"allowed: {bounds_in_words(spec)}"
        )
    if math.isinf(found) and not (spec.neutral is not None and math.isinf(spec.neutral)):
        raise DesignError("an infinite value", found=shown(raw), advice="give a finite number")


def bounds_in_words(spec: Specification) -> str:
    """What a value may be, such as "above 0" or "from 0 to 1"."""
    low, high = (f"{bound:g}" if math.isfinite(bound) else "" for bound in (spec.low, spec.high))
    if low and high:
        return f"between {low} and {high}" if spec.exclusive else f"from {low} to {high}"
    if low:
        return f"above {low}" if spec.exclusive else f"{low} or more"
    if high:
        return f"below {high}" if spec.exclusive else f"{high} or less"
    return "any number"


def read_scalar(raw: Any, target: Unit | None, parameters: Parameters) -> Scalar:
    """A float in the unit `target` (None: not known, bare numbers only), or a formula of [parameters]."""
    if isinstance(raw, bool) or not isinstance(raw, int | float | str):
        raise DesignError(
            "a number is wanted here", found=shown(raw), advice='write 0.5, "5 ms" or a formula'
        )
    if isinstance(raw, int | float):
        if math.isnan(raw):
            raise DesignError("this is not a number", found="nan", advice="give a number")
        return float(raw)
    parts = quantity(raw)
    if parts is not None:
        return _converted(raw, parts, target)
    formula = Expression(raw)
    check_names(formula, parameters.values)
    return in_unit(formula, target, parameters.dimensions)


def _converted(raw: str, parts: tuple[float, str], target: Unit | None) -> float:
    amount, symbol = parts
    if symbol == "":
        return amount
    if target is None:
        unit(symbol)
        raise UnitError(
            "a quantity where the unit of the place is not known",
            found=shown(raw),
            advice="give a bare number: no single signal decides the unit here",
        )
    try:
        return convert(amount, symbol, target)
    except UnitError as error:
        if error.known:
            raise
        raise UnitError(error.problem, found=shown(raw), advice=_wanted(target)) from error


def _wanted(target: Unit) -> str:
    if target.symbol and any(target.powers):
        return f"give it in {target.symbol}, or a unit like it"
    return "give a bare number (a signal without an entry under [signals] has no unit)"


def number(
    raw: Any, unit_name: str, *, signal: str | None = None, parameters: Parameters | None = None
) -> float:
    """A plain number in `unit_name`, from a bare number, a quantity, or a formula of parameters that have values."""
    named = parameters or Parameters()
    found = read_scalar(raw, Units(signal).resolve(unit_name), named)
    if isinstance(found, Expression):
        return float(found.evaluate(named.values, CASADI))
    assert isinstance(found, float)
    return found
