"""What drives the external inputs: the [inputs] table as stimuli."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

from delaytools.design.faults import Faults
from delaytools.design.parameters import Parameters
from delaytools.design.values import number
from delaytools.signals.expression import Expression
from delaytools.signals.stimulus import (
    Chirp,
    Doublet,
    Formula,
    Multisine,
    Noise,
    Pulse,
    Sine,
    Step,
    Stimulus,
)
from delaytools.signals.trouble import DesignError, shown

__all__ = ["INPUT_KINDS", "Setting", "stimulus"]

# key -> unit ("signal": the unit of the input); keys in the second tuple may be left out
INPUT_KINDS: dict[str, tuple[dict[str, str], tuple[str, ...]]] = {
    "step": ({"amplitude": "signal", "start": "s"}, ("start",)),
    "pulse": ({"amplitude": "signal", "start": "s", "width": "s"}, ("start",)),
    "doublet": ({"amplitude": "signal", "start": "s", "width": "s"}, ("start",)),
    "sine": ({"amplitude": "signal", "frequency": "Hz", "phase": "rad", "start": "s"}, ("phase", "start")),
    "chirp": ({"amplitude": "signal", "band": "Hz", "duration": "s", "start": "s"}, ("start",)),
    "multisine": ({"amplitude": "signal", "band": "Hz", "lines": ""}, ("lines",)),
    "noise": ({"rms": "signal", "period": "s"}, ("period",)),
    "formula": ({"formula": "text"}, ()),
}
_MAKE: dict[str, Callable[..., Stimulus]] = {
    "step": Step,
    "pulse": Pulse,
    "doublet": Doublet,
    "sine": Sine,
    "chirp": Chirp,
    "multisine": Multisine,
    "noise": Noise,
}
_ABOVE_ZERO = ("width", "frequency", "duration", "period")
_NOT_NEGATIVE = ("start", "rms")
_EXAMPLE = 'write { type = "step", amplitude = 1.0 }'


@final
@dataclass(frozen=True)
class Setting:
    """What a stimulus needs to know: the unit of its signal, the frame (s), a seed, the [parameters] as numbers."""

    unit: str = ""
    frame: float = 1e-3
    seed: int = 1
    parameters: Parameters = Parameters()


def stimulus(table: Mapping[str, Any], setting: Setting) -> Stimulus:
    """The stimulus that a table of [inputs] describes; raises DesignError that names every fault of the table."""
    kind = table.get("type")
    if kind is None:
        raise DesignError("missing required value", where="type", known=INPUT_KINDS, advice=_EXAMPLE)
    if not isinstance(kind, str) or kind not in INPUT_KINDS:
        raise DesignError("unknown type of input", where="type", found=shown(kind), known=INPUT_KINDS)
    _check_keys(kind, table)
    if kind == "formula":
        return _formula(table["formula"], setting.parameters)
    values: dict[str, Any] = {}
    faults = Faults()
    for key in (key for key in table if key != "type"):
        with faults.at(key):
            values |= _read(key, table[key], INPUT_KINDS[kind][0][key], setting)
    faults.settle()
    if kind == "noise":
        values.setdefault("period", setting.frame)
        values["seed"] = setting.seed
    return _MAKE[kind](**values)


def _check_keys(kind: str, table: Mapping[str, Any]) -> None:
    keys, optional = INPUT_KINDS[kind]
    faults = Faults()
    for key in table:
        if key not in keys and key != "type":
            with faults.at(key):
                raise DesignError(f"unknown value of a {kind}", found=repr(key), known=keys)
    for key in keys:
        if key not in table and key not in optional:
            with faults.at(key):
                raise DesignError(
                    "missing required value", found=f"a {kind} without {key}", advice=f"give {key}"
                )
    faults.settle()


def _read(key: str, raw: Any, unit_name: str, setting: Setting) -> dict[str, Any]:
    if key == "band":
        low, high = _band(raw, setting.parameters)
        return {"from_frequency": low, "to_frequency": high}
    if key == "lines":
        if isinstance(raw, bool) or not isinstance(raw, int) or raw < 1:
            raise DesignError("a count of 1 or more is wanted", found=shown(raw), advice="write lines = 32")
        return {key: raw}
    found = number(raw, unit_name, signal=setting.unit, parameters=setting.parameters)
    if not math.isfinite(found):
        raise DesignError("an infinite value", found=shown(raw), advice="give a finite number")
    if key in _ABOVE_ZERO and not found > 0:
        raise DesignError("a value above 0 is wanted", found=shown(raw))
    if key in _NOT_NEGATIVE and found < 0:
        raise DesignError("a value of 0 or more is wanted", found=shown(raw))
    return {key: found}


def _formula(raw: Any, parameters: Parameters) -> Formula:
    if not isinstance(raw, str):
        raise DesignError("a formula of t is wanted", where="formula", found=shown(raw), advice="in quotes")
    try:
        formula = Expression(raw)
        used = {name: parameters.values[name] for name in formula.names if name in parameters.values}
        return Formula(formula=formula, values=used)
    except DesignError as error:
        raise error.at("formula") from error


def _band(raw: Any, parameters: Parameters) -> tuple[float, float]:
    if not isinstance(raw, list) or len(raw) != 2:
        raise DesignError(
            "a band has two frequencies", found=shown(raw), advice='write band = ["0.5 Hz", "10 Hz"]'
        )
    low, high = (number(item, "Hz", parameters=parameters) for item in raw)
    if not 0 < low < high < math.inf:
        raise DesignError("a band runs from a lower to a higher frequency, both above 0", found=shown(raw))
    return low, high
