"""Derivatives of a run with respect to free values: the compiled step's own derivative, carried from call to call."""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.loop.network import Key
from delaytools.signals.trouble import AnalysisError
from delaytools.simulation.anew import Anew, resets
from delaytools.simulation.initial import initial_slopes
from delaytools.simulation.run import (
    Compiled,
    before_start,
    call_at,
    initial_state,
    mapped_rows,
    prepared_data,
    trimmed,
)
from delaytools.simulation.unroll import Call

__all__ = ["run_with_derivatives"]

Array = NDArray[np.float64]


def run_with_derivatives(
    compiled: Compiled,
    values: tuple[float, ...],
    *,
    anew: tuple[Anew, ...] = (),
    starts: tuple[Key, ...] = (),
    by: Sequence[int] | None = None,
) -> tuple[Array, Array, Array]:
    """(n,) s, (n, signals) rows and (n, signals, free values + starts) their derivatives, forward by CasADi.

    Exact for the compiled step, a free constant delay included (boundaries that a delay moves move with it), and
    for initial states. anew: where states are set to other values on the way. starts: states (element, state) by
    whose value at the last of these frames, or at t = 0, the rows are differentiated too. by: places of the free
    values by which rows are differentiated (None: all).
    """
    if len(values) != len(compiled.model.free):
        raise AnalysisError("one value per free path", found=str(len(values)), known=compiled.model.free)
    chosen = tuple(range(len(values)) if by is None else by)
    count, layout = len(chosen), compiled.model.layout.states
    state, sizes = initial_state(compiled, values), (len(values), len(starts))
    function = compiled.call.once((chosen, sizes), lambda: _with_tangents(compiled.call, chosen, sizes))
    own = [np.eye(1, len(state), layout.index(one)).ravel() for one in starts]
    both = np.concatenate([state, *(_initial_tangents(compiled, values)[list(chosen)] if count else ()), *own])
    calls = [call_at(compiled, one.frame) for one in anew]
    new = resets(anew, layout, calls, size=len(state), values=count, wanted=starts)
    driven = prepared_data(compiled), np.asarray(values, dtype=float)
    table = _unpacked(mapped_rows(compiled.call, function, both, driven, new), compiled, count + len(starts))
    time = compiled.frame * np.arange(compiled.frames + 1)
    return time, trimmed(compiled, table[:, 0]), np.moveaxis(trimmed(compiled, table[:, 1:]), 1, 2)


def _initial_tangents(compiled: Compiled, values: tuple[float, ...]) -> Array:
    """(free values, state) ∂(initial state)/∂value."""
    slopes = compiled.call.once("initial slopes", lambda: initial_slopes(compiled.call.made["initial"]))
    return np.asarray(slopes(before_start(compiled), np.asarray(values, dtype=float))).T


def _unpacked(rows: Array, compiled: Compiled, count: int) -> Array:
    """(rows, 1 + free values, signals) from the mapped output, which holds per call all rows, then all tangents."""
    signals, per_call = len(compiled.model.layout.signals), compiled.call.rows
    return np.moveaxis(rows.reshape(-1, 1 + count, per_call, signals), 1, 2).reshape(-1, 1 + count, signals)


def _with_tangents(call: Call, chosen: tuple[int, ...], sizes: tuple[int, int]) -> ca.Function:
    """(state and tangents, data, p) -> (state and tangents, rows and their tangents).

    chosen: places in p by which there are tangents. sizes: of p, and how many tangents by starts follow.
    """
    size, starts = sizes
    function, name = call.function, "_".join(["tangents", *map(str, chosen)])
    n, width, many = function.size1_in(0), function.size1_in(1), len(chosen) + starts
    kind = ca.SX if function.is_a("SXFunction") else ca.MX
    both, data, p = kind.sym("both", n * (1 + many)), kind.sym("data", width), kind.sym("p", size)
    new, rows = function(both[:n], data, p)
    if many == 0:
        return function
    moved, by_p = ca.reshape(both[n:], n, many), np.zeros((size, many))
    by_p[list(chosen), np.arange(len(chosen))] = 1.0
    nothing = ca.DM.zeros(width, many)
    new_dot, rows_dot = function.forward(many)(both[:n], data, p, new, rows, moved, nothing, by_p)
    outputs = ca.cse([ca.vertcat(new, ca.vec(new_dot)), ca.vertcat(rows, ca.vec(rows_dot))])
    return ca.Function(name, [both, data, p], outputs)
