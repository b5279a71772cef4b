"""Where the search for each kind of effect begins: grids of finite amplitudes, sized by the signals at its port."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.places import Spot, value_spots
from delaytools.diagnosis.views import View
from delaytools.loop.port import Port
from delaytools.loop.values import value_paths

__all__ = ["GRID", "LINEAR", "SMALL", "Candidate", "candidates", "smoothing_of"]

LATENESS = (0.3, 0.7, 1.5, 3.0, 5.0, 8.0, 12.0, 17.0, 24.0, 34.0, 48.0)  # rows of the log
WIDTHS = (0.004, 0.015, 0.05, 0.12, 0.25, 0.5, 0.8)  # of the signal's spread
CEILINGS = (0.97, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2)  # of the signal's peak, or of its largest rate
PERIODS = (2, 3, 4, 5, 8, 10, 15, 20, 30, 40)  # rows
FACTORS = (0.65, 0.85, 0.95, 1.05, 1.18, 1.5)
SMALL = 0.02  # of the scale at the port: amplitude at which a direction is taken
LINEAR, GRID = "linear", "grid"


@final
@dataclass(frozen=True)
class Candidate:
    """An effect to try: `tries` are starting points; LINEAR: the response to the first one is scaled to fit."""

    tries: tuple[Added, ...]
    manner: str
    amplitude: str = ""

    @property
    def first(self) -> Added:
        """The first starting point."""
        return self.tries[0]


def candidates(view: View, spots: tuple[Spot, ...]) -> tuple[Candidate, ...]:
    """Candidates for every spot that a profile can start from signals alone, and for every value of a block."""
    found: list[Candidate] = []
    for spot in spots:
        if spot.kind in _GRIDS:
            tries = tuple(Added(spot.kind, str(spot.port), v) for v in _GRIDS[spot.kind](view, spot.port))
            found.extend([Candidate(tries, GRID)] if tries else [])
        elif spot.kind in _DIRECTIONS:
            found.extend(_DIRECTIONS[spot.kind](view, spot))
    found.extend(_value_candidates(view))
    return tuple(found)


def _value_candidates(view: View) -> list[Candidate]:
    found = []
    loop = view.case.segment.loop
    from_tolerance = {p.path for p in view.case.tolerated}
    for block, name in value_spots(view.case.segment):
        raw = _number(loop, block, name)
        if raw is None or raw == 0:
            continue
        factors = tuple(f for f in FACTORS if f"{block}.{name}" not in from_tolerance or abs(f - 1) > 0.1)
        if name == "period":
            values: tuple[float, ...] = tuple(raw * f for f in (0.5, 2.0, 3.0))
        else:
            values = tuple(raw * f for f in factors)
        kind = f"parameter_change:{name}"
        found.append(Candidate(tuple(Added(kind, block, {name: v}) for v in values), GRID))
    return found


def _number(loop: object, block: str, name: str) -> float | None:
    return value_paths(loop).get(f"{block}.{name}")  # type: ignore[arg-type]


def _lateness(name: str) -> Callable[[View, Port], tuple[Mapping[str, float], ...]]:
    def grid(view: View, port: Port) -> tuple[Mapping[str, float], ...]:
        return tuple({name: rows * view.case.step} for rows in LATENESS)

    return grid


def _widths(name: str) -> Callable[[View, Port], tuple[Mapping[str, float], ...]]:
    def grid(view: View, port: Port) -> tuple[Mapping[str, float], ...]:
        spread = view.spread(port)[0]
        return tuple({name: part * spread} for part in WIDTHS) if spread > 0 else ()

    return grid


def _limits(view: View, port: Port) -> tuple[Mapping[str, float], ...]:
    signals = view.at(port)
    peak = max(float(np.abs(u).max()) for u in signals)
    return tuple({"limit": part * peak} for part in CEILINGS) if peak > 0 else ()


def _speeds(view: View, port: Port) -> tuple[Mapping[str, float], ...]:
    if port.kind == "rate":
        return _limits(view, port)
    fastest = view.speed(port)
    return tuple({"limit": part * fastest} for part in CEILINGS) if fastest > 0 else ()


def _periods(view: View, port: Port) -> tuple[Mapping[str, float], ...]:
    return tuple({"period": rows * view.case.step} for rows in PERIODS)


_GRIDS: dict[str, Callable[[View, Port], tuple[Mapping[str, float], ...]]] = {
    "delay": _lateness("delay"),
    "lag": _lateness("time_constant"),
    "dead_band": _widths("half_width"),
    "backlash": _widths("half_width"),
    "saturation": _limits,
    "rate_limit": _speeds,
    "sample_hold": _periods,
}


def _single(name: str, size: Callable[[View, Port], float]) -> Callable[[View, Spot], list[Candidate]]:
    def make(view: View, spot: Spot) -> list[Candidate]:
        value = size(view, spot.port)
        if not np.isfinite(value) or value == 0:
            return []
        return [Candidate((Added(spot.kind, str(spot.port), {name: value}),), LINEAR, name)]

    return make


def _coupling(view: View, spot: Spot) -> list[Candidate]:
    scale = view.derivative(spot.port) if spot.port.kind == "derivative" else view.spread(spot.port)[0]
    found = []
    for source in view.sources:
        spread = float(np.concatenate([k[source] for k in view.signals]).std())
        if spread > 0 and scale > 0 and not view.is_at(spot.port, source):
            value = {"gain": SMALL * scale / spread}
            found.append(
                Candidate((Added(spot.kind, str(spot.port), value, {"source": source}),), LINEAR, "gain")
            )
    return found


def smoothing_of(view: View, port: Port) -> float:
    """A smoothing width for friction: small against the rates seen, not so small that a run needs many steps."""
    return max(0.02 * view.state(port), 1e-9)


def _with_loads(
    view: View, spot: Spot, values: Mapping[str, float]
) -> list[tuple[Mapping[str, float], Mapping[str, str]]]:
    """The values as they are; for friction by load also for every signal beside the log that its block shows."""
    found: list[tuple[Mapping[str, float], Mapping[str, str]]] = [(values, {})]
    if spot.kind != "load_dependent_friction":
        return found
    scale = view.derivative(spot.port)
    for signal in view.case.segment.loop[spot.port.element].outputs.values():
        known = signal not in view.case.records[0] and all(signal in rows for rows in view.signals)
        size = float(np.concatenate([rows[signal] for rows in view.signals]).std()) if known else 0.0
        if size > 0:
            found.append(({**values, "coefficient": SMALL * scale / size}, {"load": signal}))
    return found


def _friction(name: str, more: Mapping[str, float]) -> Callable[[View, Spot], list[Candidate]]:
    def make(view: View, spot: Spot) -> list[Candidate]:
        scale = view.derivative(spot.port)
        width = smoothing_of(view, spot.port)
        if not 0 < scale * width < math.inf:  # nothing moves, or a hypothesis that ran away
            return []
        size = SMALL if name == "coefficient" else SMALL * scale
        values = {name: size, **{key: part * size for key, part in more.items() if key != "speed"}}
        if "speed" in more:
            values["speed"] = more["speed"] * view.state(spot.port)
        values["smoothing"] = width
        limits = {"smoothing": (0.05 * width, 20 * width)}
        return [
            Candidate((Added(spot.kind, str(spot.port), own, fixed, frozenset(), limits),), LINEAR, name)
            for own, fixed in _with_loads(view, spot, values)
        ]

    return make


_DIRECTIONS: dict[str, Callable[[View, Spot], list[Candidate]]] = {
    "bias": _single("level", lambda view, port: SMALL * view.spread(port)[0]),
    "scale_factor": _single("factor", lambda view, port: 1 + SMALL),
    "gain_drift": _single("rate", lambda view, port: SMALL / view.case.duration),
    "constant_disturbance": _single("level", lambda view, port: SMALL * view.derivative(port)),
    "cubic_damping": _single(
        "coefficient", lambda v, p: SMALL * v.derivative(p) / max(v.peak_state(p), 1e-12) ** 3
    ),
    "quadratic_drag": _single(
        "coefficient", lambda v, p: SMALL * v.derivative(p) / max(v.peak_state(p), 1e-12) ** 2
    ),
    "cubic_stiffness": _single(
        "coefficient", lambda v, p: SMALL * v.derivative(p) / max(v.position(p), 1e-12) ** 3
    ),
    "coulomb_friction": _friction("level", {}),
    "stribeck_friction": _friction("level", {"stiction": 1.6, "speed": 0.25}),
    "load_dependent_friction": _friction("coefficient", {}),
    "cross_coupling": _coupling,
}
