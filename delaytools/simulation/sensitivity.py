"""Derivatives of a run with respect to free values: the compiled step's own derivative, carried from call to call."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.loop.network import Key
from delaytools.signals.trouble import AnalysisError
from delaytools.simulation.anew import Anew, resets
from delaytools.simulation.run import Compiled, call_at, initial_state, mapped_rows, prepared_data, trimmed
from delaytools.simulation.unroll import Call

__all__ = ["run_with_derivatives"]

Array = NDArray[np.float64]


def run_with_derivatives(
    compiled: Compiled,
    values: tuple[float, ...],
    *,
    anew: tuple[Anew, ...] = (),
    starts: tuple[Key, ...] = (),
    by_values: bool = True,
) -> tuple[Array, Array, Array]:
    """(n,) s, (n, signals) rows and (n, signals, free values + starts) their derivatives, forward by CasADi.

    Exact for the compiled step, a free constant delay included (boundaries that a delay moves move with it), and
    for initial states that are free values themselves or proportional to them. anew: where states are set to other
    values on the way. starts: states (element, state) by whose value at the last of these frames, or at t = 0, the
    rows are differentiated too. by_values: whether by the free values at all.
    """
    if len(values) != len(compiled.model.free):
        raise AnalysisError("one value per free path", found=str(len(values)), known=compiled.model.free)
    count = len(values) if by_values else 0
    state, layout = np.asarray(initial_state(compiled, values)).ravel(), compiled.model.layout.states
    sizes = len(values), len(starts)
    function = compiled.call.once((count, sizes), lambda: _with_tangents(compiled.call, count, sizes))
    own = [np.eye(1, len(state), layout.index(one)).ravel() for one in starts]
    both = np.concatenate([state, *(_initial_tangents(compiled, values) if count else ()), *own])
    calls = [call_at(compiled, one.frame) for one in anew]
    new = resets(anew, layout, calls, size=len(state), values=count, wanted=starts)
    driven = prepared_data(compiled), np.asarray(values, dtype=float)
    table = _unpacked(mapped_rows(compiled.call, function, both, driven, new), compiled, count + len(starts))
    time = compiled.frame * np.arange(compiled.frames + 1)
    return time, trimmed(compiled, table[:, 0]), np.moveaxis(trimmed(compiled, table[:, 1:]), 1, 2)


def _initial_tangents(compiled: Compiled, values: tuple[float, ...]) -> list[Array]:
    """∂(initial state)/∂value for each free value, by central differences: exact where it is linear in them."""
    found = []
    for index, number in enumerate(values):
        step = 1e-6 * max(1.0, abs(number))
        ends = [
            np.asarray(initial_state(compiled, (*values[:index], number + side, *values[index + 1 :]))).ravel()
            for side in (step, -step)
        ]
        found.append((ends[0] - ends[1]) / (2 * step))
    return found


def _unpacked(rows: Array, compiled: Compiled, count: int) -> Array:
    """(rows, 1 + free values, signals) from the mapped output, which holds per call all rows, then all tangents."""
    signals, per_call = len(compiled.model.layout.signals), compiled.call.rows
    return np.moveaxis(rows.reshape(-1, 1 + count, per_call, signals), 1, 2).reshape(-1, 1 + count, signals)


def _with_tangents(call: Call, count: int, sizes: tuple[int, int]) -> ca.Function:
    """(state and tangents, data, p) -> (state and tangents, rows and their tangents).

    count: tangents by the first values of p. sizes: of p, and how many tangents by starts follow.
    """
    size, starts = sizes
    function = call.function
    n, width, many = function.size1_in(0), function.size1_in(1), count + starts
    kind = ca.SX if function.is_a("SXFunction") else ca.MX
    both, data, p = kind.sym("both", n * (1 + many)), kind.sym("data", width), kind.sym("p", size)
    new, rows = function(both[:n], data, p)
    if many == 0:
        return ca.Function("tangents_0", [both, data, p], [new, rows])
    moved, by_p = ca.reshape(both[n:], n, many), np.eye(size, many)
    by_p[:, count:] = 0.0
    nothing = ca.DM.zeros(width, many)
    new_dot, rows_dot = function.forward(many)(both[:n], data, p, new, rows, moved, nothing, by_p)
    outputs = ca.cse([ca.vertcat(new, ca.vec(new_dot)), ca.vertcat(rows, ca.vec(rows_dot))])
    return ca.Function(f"tangents_{count}", [both, data, p], outputs)
