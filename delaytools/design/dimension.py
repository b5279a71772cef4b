"""The dimension of a formula of [parameters], so that its value is held in the unit of its place."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

from delaytools.signals.expression import Expression
from delaytools.signals.units import Unit

__all__ = ["NONE", "dimension_of", "in_unit"]

Powers = tuple[float, ...]
NONE: Powers = (0,) * 7


@final
@dataclass(frozen=True)
class _Dimension:
    """Powers of (angle, time, length, mass, volt, ampere, kelvin), carried through the operations of a formula.

    In a sum the first term with a dimension decides; whether the terms agree is not checked.
    """

    powers: Powers

    def __add__(self, other: Any) -> "_Dimension":
        return self if any(self.powers) else _Dimension(_powers(other))

    __radd__ = __sub__ = __rsub__ = __add__

    def __mul__(self, other: Any) -> "_Dimension":
        return _Dimension(tuple(a + b for a, b in zip(self.powers, _powers(other), strict=True)))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "_Dimension":
        return _Dimension(tuple(a - b for a, b in zip(self.powers, _powers(other), strict=True)))

    def __rtruediv__(self, other: Any) -> "_Dimension":
        return _Dimension(tuple(b - a for a, b in zip(self.powers, _powers(other), strict=True)))

    def __pow__(self, exponent: Any) -> "_Dimension":
        times = exponent if isinstance(exponent, float) else 0.0
        return _Dimension(tuple(times * a for a in self.powers))

    def __rpow__(self, base: float) -> "_Dimension":
        return _Dimension(NONE)

    def __neg__(self) -> "_Dimension":
        return self


def _powers(item: Any) -> Powers:
    return item.powers if isinstance(item, _Dimension) else NONE


def _bare(*items: Any) -> _Dimension:
    return _Dimension(NONE)


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **dict.fromkeys(("sign", "sin", "cos", "tan", "tanh", "exp", "log"), _bare),
    "abs": lambda a: a,
    "sqrt": lambda a: _Dimension(_powers(a)) ** 0.5,
    "min": lambda a, b: _Dimension(_powers(a)) + b,
    "max": lambda a, b: _Dimension(_powers(a)) + b,
}


def dimension_of(formula: Expression, dimensions: Mapping[str, Powers]) -> Powers:
    """The powers of a formula whose names have these powers (names without an entry: none)."""
    named = {name: _Dimension(tuple(dimensions.get(name, NONE))) for name in formula.names}
    return _powers(formula.evaluate(named, _FUNCTIONS))


def in_unit(formula: Expression, target: Unit | None, dimensions: Mapping[str, Powers]) -> Expression:
    """The formula, whose parameters with units are in SI, with its value in the unit of its place.

    A formula of bare numbers is in that unit already; where dimensions differ nothing is converted.
    """
    if target is None or target.scale == 1.0 or not any(target.powers):
        return formula
    if tuple(dimension_of(formula, dimensions)) != tuple(target.powers):
        return formula
    return Expression(f"({formula.text})/{target.scale!r}")
