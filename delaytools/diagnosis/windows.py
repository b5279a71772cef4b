"""Candidates that act in one stretch of time: transient gains."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.places import Spot
from delaytools.diagnosis.screen import Base, Screened, response

__all__ = ["transients", "with_edges_fitted"]

Array = NDArray[np.float64]
SMALL = 0.02
CELLS = 400  # stretches of time between which the edges of a transient are sought
SHORTEST = 2  # cells


def transients(base: Base, spots: Sequence[Spot]) -> list[Screened]:
    """The stretch of time in which another gain takes most off the residual, at every port for gains."""
    found = []
    for spot in (s for s in spots if s.kind == "transient_gain"):
        whole = Added("scale_factor", str(spot.port), {"factor": 1 + SMALL})
        change = response(base, whole)
        if change is None:
            continue
        start, end, scale, gain = _best_stretch(base, base.projected(change))
        values = {"factor": 1 + SMALL * scale, "start": start, "end": end}
        one = Added(spot.kind, str(spot.port), values, {}, frozenset({"start", "end"}))
        found.append(Screened(one, gain))
    return found


def _best_stretch(base: Base, change: Array) -> tuple[float, float, float, float]:
    """start, end (s), scale and χ² gain of the best run of cells."""
    rows = base.case.rows
    cell = np.minimum((rows.time / base.case.duration * CELLS).astype(int), CELLS - 1)
    up = np.concatenate([[0.0], np.cumsum(np.bincount(cell, change * base.residual, CELLS))])
    down = np.concatenate([[0.0], np.cumsum(np.bincount(cell, change * change, CELLS))])
    rise, power = up[None, :] - up[:, None], down[None, :] - down[:, None]
    long = np.arange(CELLS + 1)[None, :] - np.arange(CELLS + 1)[:, None]
    allowed = (long >= SHORTEST) & (long < CELLS) & (power > 1e-9 * max(down[-1], 1e-300))
    gain = np.where(allowed, rise**2 / np.where(allowed, power, 1.0), 0.0)
    first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
    width = base.case.duration / CELLS
    scale = rise[first, last] / max(power[first, last], 1e-300)
    return float(first * width), float(last * width), float(scale), float(gain[first, last])


def with_edges_fitted(base: Base, one: Added) -> Screened:
    """The transient with start and end moved to where most is taken off; its factor scaled to fit."""
    width = base.case.duration / CELLS

    def loss(edges: Array) -> float:
        start, end = one.values["start"] + edges[0] * width, one.values["end"] + edges[1] * width
        if end - start < base.case.step or start < -width:
            return 0.0
        change = response(base, one.moved({"start": max(start, 0.0), "end": end}))
        return 0.0 if change is None else -base.gain(change)[0]

    simplex = np.array([[0.0, 0.0], [0.7, 0.0], [0.0, 0.7]])
    options = {"maxfev": 45, "initial_simplex": simplex, "xatol": 0.01, "fatol": 0.05}
    found = minimize(loss, np.zeros(2), method="Nelder-Mead", options=options)
    start = max(one.values["start"] + found.x[0] * width, 0.0)
    moved = one.moved({"start": start, "end": one.values["end"] + found.x[1] * width})
    change = response(base, moved)
    gain, scale = (0.0, 1.0) if change is None else base.gain(change)
    return Screened(moved.moved({"factor": 1 + scale * (one.values["factor"] - 1)}), gain)
