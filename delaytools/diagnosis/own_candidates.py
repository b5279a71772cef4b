"""Effects from outside the catalogue as candidates: one direction at every port where they can act."""

from collections.abc import Mapping
from dataclasses import MISSING, fields

import numpy as np

from delaytools.blocks.block import specifications
from delaytools.design.catalogue import EFFECTS
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.starts import LINEAR, Candidate
from delaytools.diagnosis.views import View
from delaytools.effects.effect import Effect
from delaytools.loop.port import Port, ports

__all__ = ["own_candidates"]

SMALL = 0.02  # of the scale at the port


def own_candidates(view: View) -> tuple[Candidate, ...]:
    """Candidates for every kind of effect that a package or a program offers.

    The first value with a neutral value is the amplitude; a kind is left out where another value has neither a
    neutral value nor a default, since a search would not know where to begin.
    """
    found = []
    for name in (name for name in EFFECTS if name not in EFFECTS.own):
        for block in view.case.segment.blocks:
            for port in ports(view.case.segment.loop[block]):
                values = _start(EFFECTS[name], view, port) if port.kind in EFFECTS[name].acts_on else {}
                if values:
                    one = Added(name, str(port), values)
                    found.append(Candidate((one,), LINEAR, next(iter(values))))
    return tuple(found)


def _start(kind: type[Effect], view: View, port: Port) -> Mapping[str, float]:
    """Values a little off neutral, the amplitude first; nothing where one is not known."""
    specs = specifications(kind)
    defaults = {f.name: f.default for f in fields(kind) if f.name in specs and f.default is not MISSING}  # type: ignore[arg-type]
    names = sorted(specs, key=lambda name: specs[name].neutral is None)
    found: dict[str, float] = {}
    for name in names:
        spec = specs[name]
        neutral = spec.neutral if spec.neutral is not None and np.isfinite(spec.neutral) else None
        if neutral is not None:
            scale = _scale(spec.unit, view, port) if not found else 0.0
            found[name] = float(np.clip(neutral + SMALL * scale, spec.low, spec.high))
        elif isinstance(defaults.get(name), int | float) and found:
            found[name] = float(defaults[name])
        elif defaults.get(name, MISSING) is not None:
            return {}
    return found


def _scale(unit: str, view: View, port: Port) -> float:
    if unit == "derivative" and port.kind == "derivative":
        return view.derivative(port)
    if unit == "signal" and port.kind in ("input", "output"):
        return view.spread(port)[0]
    return 1.0
