"""Calls that are affine in their state and data: matrices instead of a walk, found by unit vectors."""

from collections.abc import Sequence
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.simulation.anew import Reset

__all__ = ["affine_rows", "is_affine", "side_by_side"]

Array = NDArray[np.float64]
_SUMS = {ca.OP_ADD, ca.OP_SUB}
_SAME = {ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE}


def is_affine(function: ca.Function) -> bool:
    """Whether the outputs of an SX function are affine in its first two inputs, as it is written.

    By the degree of every instruction's result: 0 for what the third input alone decides, 1 for what is affine.
    """
    if not function.is_a("SXFunction"):
        return False
    degree = np.zeros(function.sz_w(), dtype=int)
    for k in range(function.n_instructions()):
        kind, read = function.instruction_id(k), function.instruction_input(k)
        if kind == ca.OP_OUTPUT:
            if degree[read[0]] > 1:
                return False
            continue
        degree[function.instruction_output(k)[0]] = _degree(kind, read, degree)
    return True


def _degree(kind: int, read: Sequence[int], known: NDArray[np.int64]) -> int:
    if kind == ca.OP_INPUT:
        return int(read[0] < 2)
    if kind == ca.OP_CONST:
        return 0
    degrees = [int(known[place]) for place in read]
    if kind in _SUMS or kind in _SAME:
        return max(degrees)
    if kind == ca.OP_MUL:
        return sum(degrees)
    if kind == ca.OP_DIV and degrees[1] == 0:
        return degrees[0]
    return 2 if any(degrees) else 0


def affine_rows(
    points: ca.Function, state: Array, driven: tuple[Array, Array], new: Sequence[Reset] = ()
) -> Array:
    """(calls, numbers per call) what an affine function gives call after call; as `run.mapped_rows`.

    points: `side_by_side` of (state, data, p) -> (next state, rows). driven: data per call (calls, width), and p.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # an unstable run ends in inf, as it does when walked
        return _rows(points, state, driven, new)


def _rows(points: ca.Function, state: Array, driven: tuple[Array, Array], new: Sequence[Reset]) -> Array:
    data, p = driven
    n = len(state)
    slopes, offset = _matrices(points, n, p)
    sent = data @ slopes[n:] + offset
    states = np.empty((len(data) + 1, n))
    states[0] = state
    edges = sorted({0, len(data), *(one.call for one in new if one.call < len(data))})
    for first, last in pairwise(edges):
        for one in (one for one in new if one.call == first):
            states[first, one.places] = one.values
        _advance(states[first : last + 1], np.ascontiguousarray(slopes[:n, :n].T), sent[first:last, :n])
    return np.asarray(states[:-1] @ slopes[:n, n:] + sent[:, n:])


def _advance(states: Array, onward: Array, moved: Array) -> None:
    """(k + 1, n) states from the first one on: x -> onward x + moved, in place."""
    rows = list(states)
    for x, after, more in zip(rows, rows[1:], list(moved), strict=False):
        np.dot(onward, x, out=after)
        after += more


def side_by_side(function: ca.Function) -> ca.Function:
    """The function, whose outputs are dense, at one point more than its state and data have numbers."""
    return function.map(1 + function.size1_in(0) + function.size1_in(1))


def _matrices(points: ca.Function, n: int, p: Array) -> tuple[Array, Array]:
    """(n + width, n + rows) what each unit of state and data adds to the next state and the rows, and (n + rows,) rest.

    The units are scaled so that the rest does not hide what they do.
    """
    count = points.size2_in(0)
    units = np.eye(count, count - 1, -1)
    found, scale = _evaluated(points, units, n, p), 1.0
    if (largest := float(np.abs(found[0]).max(initial=0.0))) > scale:
        found, scale = _evaluated(points, largest * units, n, p), largest
    return (found[1:] - found[0]) / scale, found[0]


def _evaluated(points: ca.Function, given: Array, n: int, p: Array) -> Array:
    """(points, n + rows) for (points, n + width) given."""
    count = len(given)
    parts = [np.ascontiguousarray(part) for part in (given[:, :n], given[:, n:], np.tile(p, (count, 1)))]
    found = [np.empty((count, points.size1_out(k))) for k in range(2)]
    buffer, evaluate = points.buffer()
    for place, part in enumerate(parts):
        if part.size:
            buffer.set_arg(place, memoryview(part))
    for place, part in enumerate(found):
        if part.size:
            buffer.set_res(place, memoryview(part))
    evaluate()
    return np.hstack(found)
