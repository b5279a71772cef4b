"""What drives the external inputs: the [inputs] table as stimuli."""

from collections.abc import Callable, Mapping
from typing import Any

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
from delaytools.signals.trouble import DesignError

__all__ = ["INPUT_KINDS", "stimulus"]

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


def stimulus(table: Mapping[str, Any], *, signal_unit: str, frame: float, seed: int) -> Stimulus:
    """The stimulus that a table of [inputs] describes; raises DesignError for an unknown type or key."""
    kind = table.get("type")
    if kind not in INPUT_KINDS:
        raise DesignError("unknown type of input", found=repr(kind), known=INPUT_KINDS)
    keys, optional = INPUT_KINDS[kind]
    for key in table:
        if key not in keys and key != "type":
            raise DesignError(f"unknown value of a {kind}", found=repr(key), known=keys)
    for key in keys:
        if key not in table and key not in optional:
            raise DesignError("missing required value", found=f"a {kind} without {key}", advice=f"give {key}")
    if kind == "formula":
        return Formula(formula=Expression(str(table["formula"])))
    values: dict[str, Any] = {}
    for key, raw in table.items():
        if key == "type":
            continue
        if key == "band":
            values["from_frequency"], values["to_frequency"] = _band(raw)
        elif key == "lines":
            values[key] = int(raw)
        else:
            values[key] = number(raw, keys[key], signal=signal_unit)
    if kind == "noise":
        values.setdefault("period", frame)
        values["seed"] = seed
    return _MAKE[kind](**values)


def _band(raw: Any) -> tuple[float, float]:
    if not isinstance(raw, list) or len(raw) != 2:
        raise DesignError(
            "a band has two frequencies", found=repr(raw), advice='write band = ["0.5 Hz", "10 Hz"]'
        )
    low, high = (number(item, "Hz") for item in raw)
    if not 0 < low < high:
        raise DesignError("a band runs from a lower to a higher frequency", found=repr(raw))
    return low, high
