"""Derivatives of a run with respect to free values: the compiled step's own derivative, carried from call to call."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.signals.trouble import AnalysisError
from delaytools.simulation.run import Compiled, initial_state, mapped_rows, prepared_data, trimmed
from delaytools.simulation.unroll import Call

__all__ = ["run_with_derivatives"]

Array = NDArray[np.float64]


def run_with_derivatives(compiled: Compiled, values: tuple[float, ...]) -> tuple[Array, Array, Array]:
    """(n,) s, (n, signals) rows and (n, signals, free values) ∂row/∂value, by forward differentiation in CasADi.

    Exact for the compiled step, a free constant delay included (boundaries that a delay moves move with it), and
    for initial states that are free values themselves or proportional to them.
    """
    count = len(values)
    if count != len(compiled.model.free):
        raise AnalysisError("one value per free path", found=str(count), known=compiled.model.free)
    state = np.asarray(initial_state(compiled, values)).ravel()
    function = _with_tangents(compiled.call, count)
    both = np.concatenate([state, *_initial_tangents(compiled, values)])
    rows = mapped_rows(
        compiled.call, function, both, (prepared_data(compiled), np.asarray(values, dtype=float))
    )
    table = _unpacked(rows, compiled, count)
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


def _with_tangents(call: Call, count: int) -> ca.Function:
    """(state and tangents, data, p) -> (state and tangents, rows and their tangents)."""
    function = call.function
    n, width = function.size1_in(0), function.size1_in(1)
    both, data, p = ca.MX.sym("both", n * (1 + count)), ca.MX.sym("data", width), ca.MX.sym("p", count)
    state = both[:n]
    new, rows = function(state, data, p)
    tangent = function.forward(1)
    states, outputs = [new], [rows]
    for k in range(count):
        seed = np.zeros(count)
        seed[k] = 1.0
        moved = both[n * (1 + k) : n * (2 + k)]
        new_dot, rows_dot = tangent(state, data, p, new, rows, moved, ca.DM.zeros(width), seed)
        states.append(new_dot)
        outputs.append(rows_dot)
    return ca.Function("tangents", [both, data, p], [ca.vertcat(*states), ca.vertcat(*outputs)])
