"""From element to element of time: all signals are polynomials there, one constant matrix for each length of element.

The method of steps with collocation at Chebyshev's points: Bellen & Zennaro, Numerical Methods for Delay Differential
Equations (2003), ch. 3.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from delaytools.linear.delay_system import DelaySystem

__all__ = ["DEGREE", "History", "elements", "march"]

RealArray = NDArray[np.float64]
Waves = Callable[[RealArray], RealArray]

DEGREE = 20
_MOVES = 6.0  # |λ| times the length of an element at most: e^{3x} is such a polynomial to 1e-15
_POINTS = np.cos(np.pi * np.arange(DEGREE, -1, -1) / DEGREE)  # Chebyshev's points of the second kind, -1 to 1
_TO_SERIES = np.linalg.inv(chebyshev.chebvander(_POINTS, DEGREE))
_INTEGRAL = np.stack([chebyshev.chebval(_POINTS, chebyshev.chebint(row, lbnd=-1)) for row in _TO_SERIES.T], axis=1)


def elements(system: DelaySystem, breaks: RealArray, end: float) -> RealArray:
    """The edges of elements, 0 to end: at every break, no longer than the shortest delay nor than the fastest mode."""
    fastest = float(np.abs(np.linalg.eigvals(system.A)).max(initial=0.0)) if system.n_states else 0.0
    longest = min([end, *(span for span in system.delays if span > 0), _MOVES / fastest if fastest else end])
    edges = np.concatenate([[0.0], breaks, [end]])
    parts = [
        np.linspace(a, b, int(np.ceil((b - a) / longest * (1 - 1e-12))) + 1)[:-1]
        for a, b in pairwise(edges)
    ]
    return np.append(np.concatenate(parts), end)


@final
@dataclass(frozen=True, eq=False)
class History:
    """What has been: edges (k + 1,) s; z (k, m, N + 1) and y (k, ny, N + 1) as Chebyshev series on each element."""

    edges: RealArray
    z: RealArray
    y: RealArray

    def outputs(self, times: RealArray) -> RealArray:
        """y (ny, len(times)), from the right at an edge, from the left at the end."""
        return _values(self.edges, self.y, times, times)


def _values(edges: RealArray, series: RealArray, times: RealArray, within: RealArray) -> RealArray:
    """Series (k, c, N + 1) at times, each in the element that holds the moment `within` beside it: (c, len(times))."""
    place = np.clip(np.searchsorted(edges, within, side="right") - 1, 0, len(series) - 1)
    x = 2 * (times - edges[place]) / (edges[place + 1] - edges[place]) - 1
    return np.einsum("tcn,tn->ct", series[place], chebyshev.chebvander(np.clip(x, -1.0, 1.0), DEGREE))


def march(system: DelaySystem, edges: RealArray, waves: Waves, begin: RealArray) -> History:
    """All elements, one after the other: x' = A x + B1 u + B2 w, with w from the elements that are done."""
    n, m = system.n_states, system.n_channels
    count = len(edges) - 1
    z, y = np.zeros((count, m, DEGREE + 1)), np.zeros((count, system.shape[0], DEGREE + 1))
    moves: dict[float, RealArray] = {}
    x = begin
    for k in range(count):
        a, width = edges[k], edges[k + 1] - edges[k]
        t = a + width * (_POINTS + 1) / 2
        u = waves(np.clip(t, a + 1e-13 * width, edges[k + 1] - 1e-13 * width))
        late = [_late(edges, z[:, i], (t, span), k) for i, span in enumerate(system.delays)]
        w = np.stack(late) if m else np.zeros((0, len(t)))
        entering = system.B1 @ u + system.B2 @ w
        key = float(f"{width:.12e}")  # elements of one length but for rounding share a matrix
        if key not in moves:
            moves[key] = _move(system.A, width)
        states = (moves[key] @ np.concatenate([x, entering.T.ravel()])).reshape(DEGREE + 1, n).T
        z[k] = (system.C2 @ states + system.D21 @ u + system.D22 @ w) @ _TO_SERIES.T
        y[k] = (system.C1 @ states + system.D11 @ u + system.D12 @ w) @ _TO_SERIES.T
        x = states[:, -1]
    return History(edges, z, y)


def _late(edges: RealArray, series: RealArray, at: tuple[RealArray, float], done: int) -> RealArray:
    """One channel's input at the times t - span: inside the elements that are done, each point from its own side."""
    t, span = at
    if done == 0:
        return np.zeros(len(t))
    inner = 1e-9 * (t[-1] - t[0])  # the ends belong to this element's side of a break
    within = np.clip(t, t[0] + inner, t[-1] - inner) - span
    found = _values(edges[: done + 1], series[:done, None, :], t - span, within)[0]
    return np.where(within < 0, 0.0, found)


def _move(A: RealArray, width: float) -> RealArray:
    """((N + 1) n, n + n (N + 1)): states at the points of an element from those at its beginning and x' - A x there.

    X = x(a) + (width/2) J (A X + F), J the integral of the polynomial through the points.
    """
    n, size = len(A), DEGREE + 1
    half = width / 2
    integral, unit = np.kron(half * _INTEGRAL, np.eye(n)), np.eye(size * n)
    begin = np.kron(np.ones((size, 1)), np.eye(n))
    return np.asarray(np.linalg.solve(unit - np.kron(half * _INTEGRAL, A), np.hstack([begin, integral])))
