"""Two unrelated integrators of a smooth interval: DOP853, and Chebyshev collocation by Picard sweeps.

Each takes a field, the ends of the interval, the states at its start and their full scale so far, and returns
stretches `(start, end, solution)`, where `solution(t)` gives the states, shape `(n,)` or `(n, len(t))`.
A field is called as `field(t)(x)`: what depends on time alone is looked up once per `t`.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

Array = NDArray[np.float64]
Field = Callable[[float | Array], Callable[[Array], Array]]
Solution = Callable[[float | Array], Array]
Stretch = tuple[float, float, Solution]
Integrator = Callable[[Field, float, float, Array, Array], list[Stretch]]

NODES = 22          # Chebyshev-Lobatto nodes of one stretch
SWEEPS = 80         # Picard sweeps before a stretch is halved
SETTLED = 1e-15     # relative change at which the sweeps end
TAIL = 5e-15        # relative size of the last Chebyshev coefficients of a resolved stretch
HALVINGS = 8
LOST = 1e-11        # a stretch that is halved so often and still no better has a kink inside: an error


def dop853(field: Field, start: float, end: float, x: Array, full: Array) -> list[Stretch]:
    """Dormand-Prince 8(5,3), rtol 1e-12, atol 1e-13; steps up to 1 ms (its dense output is of 7th order)."""
    del full
    step = min(end - start, 1e-3)
    solver = DOP853(
        lambda t, y: field(t)(y), start, x, end, first_step=step, max_step=1e-3, rtol=1e-12, atol=1e-13
    )
    found: list[Stretch] = []
    while solver.status == "running":
        message = solver.step()
        if solver.status == "failed":
            raise ArithmeticError(f"DOP853 stopped at t = {solver.t}: {message}")
        found.append((solver.t_old, solver.t, solver.dense_output()))
    return found


def collocation(
    field: Field, start: float, end: float, x: Array, full: Array, halvings: int = HALVINGS
) -> list[Stretch]:
    """Collocation of x = x0 + integral of the field; halved until the last coefficients are rounding."""
    nodes, integral, coefficients = _chebyshev()
    half = (end - start) / 2
    rate_at = field(start + half * (nodes + 1))
    values = np.repeat(x[:, None], NODES, axis=1)
    for _ in range(SWEEPS):
        rates = rate_at(values)
        swept = x[:, None] + half * rates @ integral.T
        scale = np.maximum(full, np.abs(swept).max(axis=1) + half * np.abs(rates).max(axis=1)) + 1e-300
        change = (np.abs(swept - values).max(axis=1) / scale).max()
        values = swept
        if change < SETTLED:
            break
    tail = (np.abs(values @ coefficients[-3:].T).max(axis=1) / scale).max()
    if halvings and (change > 10 * SETTLED or tail > TAIL):
        left = collocation(field, start, start + half, x, full, halvings - 1)
        return left + collocation(field, start + half, end, left[-1][2](start + half), full, halvings - 1)
    if max(change, tail) > LOST:
        raise ArithmeticError(f"not smooth from t = {start} to {end}: a breakpoint is missing")
    return [(start, end, _interpolant(start, half, values))]


@cache
def _chebyshev() -> tuple[Array, Array, Array]:
    """Nodes on [-1, 1]; matrix of integrals from -1 to each node; matrix from values to coefficients."""
    nodes = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    basis = np.polynomial.chebyshev.chebvander(nodes, NODES - 1)
    coefficients = np.linalg.inv(basis)
    primitive = np.polynomial.chebyshev.chebint(np.eye(NODES), lbnd=-1, axis=0)
    integral = np.polynomial.chebyshev.chebvander(nodes, NODES) @ primitive @ coefficients
    integral[0] = 0.0
    return nodes, integral, coefficients


@cache
def _weights() -> Array:
    """Barycentric weights of the Chebyshev-Lobatto nodes."""
    weights = (-1.0) ** np.arange(NODES)
    weights[[0, -1]] /= 2
    return weights


def _interpolant(start: float, half: float, values: Array) -> Solution:
    """The polynomial through the nodal values (barycentric, second form)."""
    nodes = _chebyshev()[0]

    def solution(t: float | Array) -> Array:
        place = np.atleast_1d((np.asarray(t) - start) / half - 1)
        gaps = place[:, None] - nodes
        hits = np.abs(gaps) < 1e-14
        gaps[hits] = 1.0
        shares = _weights() / gaps
        rows = hits.any(axis=1)
        shares[rows] = hits[rows]
        found = values @ (shares / shares.sum(axis=1, keepdims=True)).T
        return found if np.ndim(t) else found[:, 0]

    return solution
