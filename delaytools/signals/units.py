"""The units a control engineer writes, and quantities made of a number and a unit."""

import math
import re
from dataclasses import dataclass
from typing import final

from delaytools.signals.trouble import UnitError

__all__ = ["Unit", "convert", "quantity", "same_dimension", "unit"]

_TIME = 1  # place of the power of time


def _base(scale: float, powers: dict[str, int]) -> tuple[float, tuple[int, ...]]:
    order = ("angle", "time", "length", "mass", "volt", "ampere", "kelvin")
    return scale, tuple(powers.get(name, 0) for name in order)


_G = 9.80665
_TABLE: dict[str, tuple[float, tuple[int, ...]]] = {
    "rad": _base(1.0, {"angle": 1}),
    "mrad": _base(1e-3, {"angle": 1}),
    "deg": _base(math.pi / 180, {"angle": 1}),
    "arcmin": _base(math.pi / 10800, {"angle": 1}),
    "rev": _base(2 * math.pi, {"angle": 1}),
    "Hz": _base(2 * math.pi, {"angle": 1, "time": -1}),
    "kHz": _base(2e3 * math.pi, {"angle": 1, "time": -1}),
    "rpm": _base(math.pi / 30, {"angle": 1, "time": -1}),
    "s": _base(1.0, {"time": 1}),
    "ms": _base(1e-3, {"time": 1}),
    "us": _base(1e-6, {"time": 1}),
    "µs": _base(1e-6, {"time": 1}),
    "min": _base(60.0, {"time": 1}),
    "m": _base(1.0, {"length": 1}),
    "cm": _base(1e-2, {"length": 1}),
    "mm": _base(1e-3, {"length": 1}),
    "um": _base(1e-6, {"length": 1}),
    "km": _base(1e3, {"length": 1}),
    "ft": _base(0.3048, {"length": 1}),
    "kg": _base(1.0, {"mass": 1}),
    "slug": _base(14.593902937206, {"mass": 1}),
    "N": _base(1.0, {"mass": 1, "length": 1, "time": -2}),
    "kN": _base(1e3, {"mass": 1, "length": 1, "time": -2}),
    "Nm": _base(1.0, {"mass": 1, "length": 2, "time": -2}),
    "Pa": _base(1.0, {"mass": 1, "length": -1, "time": -2}),
    "kPa": _base(1e3, {"mass": 1, "length": -1, "time": -2}),
    "J": _base(1.0, {"mass": 1, "length": 2, "time": -2}),
    "W": _base(1.0, {"mass": 1, "length": 2, "time": -3}),
    "g": _base(_G, {"length": 1, "time": -2}),
    "V": _base(1.0, {"volt": 1}),
    "mV": _base(1e-3, {"volt": 1}),
    "A": _base(1.0, {"ampere": 1}),
    "K": _base(1.0, {"kelvin": 1}),
    "degC": _base(1.0, {"kelvin": 1}),
    "%": _base(1e-2, {}),
    "1": _base(1.0, {}),
    "": _base(1.0, {}),
    "count": _base(1.0, {}),
}
_QUANTITY = re.compile(r"^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?inf)\s*(.*?)\s*$")
_FACTOR = re.compile(r"^([A-Za-zµ%1]+?)(?:\^?(-?\d+)|²)?$")


@final
@dataclass(frozen=True)
class Unit:
    """A unit: `scale` in SI and the powers of (angle, time, length, mass, volt, ampere, kelvin)."""

    symbol: str
    scale: float
    powers: tuple[int, ...]

    def per_second(self, times: int = 1) -> "Unit":
        """The unit of the `times`-th derivative with respect to time."""
        powers = list(self.powers)
        powers[_TIME] -= times
        suffix = "/s" if times == 1 else f"/s^{times}"
        return Unit((self.symbol or "1") + suffix, self.scale, tuple(powers))


def unit(symbol: str) -> Unit:
    """The unit written as `symbol`, such as "deg/s", "m/s^2" or "N*m".

    Raises UnitError for a symbol that is not in the table.
    """
    scale, powers = 1.0, [0] * 7
    sign = 1
    for token in re.split(r"([*·/])", symbol.replace(" ", "").replace("**", "^")) if symbol.strip() else ():
        if token in ("*", "·"):
            sign = 1
        elif token == "/":
            sign = -1
        else:
            factor, exponent = _factor(token, symbol)
            scale *= factor.scale ** (sign * exponent)
            powers = [p + sign * exponent * q for p, q in zip(powers, factor.powers, strict=True)]
    return Unit(symbol, scale, tuple(powers))


def _factor(token: str, symbol: str) -> tuple[Unit, int]:
    match = _FACTOR.match(token)
    if match is None or match.group(1) not in _TABLE:
        known = [name for name in _TABLE if len(name) > 0 and name != "1"]
        inside = "" if token == symbol else f" in {symbol!r}"
        advice = "write the unit with these, * and / (m/s^2)"
        raise UnitError(f"unknown unit{inside}", found=repr(token), known=known, advice=advice)
    exponent = 2 if token.endswith("²") else int(match.group(2) or 1)
    scale, powers = _TABLE[match.group(1)]
    return Unit(match.group(1), scale, powers), exponent


def same_dimension(first: Unit, second: Unit) -> bool:
    """Whether a quantity in the one unit can be written in the other."""
    return first.powers == second.powers


def convert(number: float, source: str | Unit, target: str | Unit) -> float:
    """`number` in unit `source`, written in unit `target`; raises UnitError where dimensions differ."""
    one = unit(source) if isinstance(source, str) else source
    other = unit(target) if isinstance(target, str) else target
    if not same_dimension(one, other):
        raise UnitError(
            "wrong dimension",
            found=one.symbol or "a number without a unit",
            advice=f"give it in {other.symbol}, or a unit like it" if other.symbol else "give a bare number",
        )
    return number * one.scale / other.scale if one.symbol != other.symbol else number


def quantity(text: str) -> tuple[float, str] | None:
    """The number and unit of "15 ms", or None where the text does not begin with a number and end in a unit."""
    match = _QUANTITY.match(text)
    if match is None or (match.group(2) and not re.match(r"^([A-Za-zµ%]|1/)", match.group(2))):
        return None
    return float(match.group(1)), match.group(2)
