"""First guesses of characteristic roots: each delay line by polynomial collocation at Chebyshev points."""

from math import ceil

import numpy as np
from numpy.typing import NDArray

from delaytools.linear.channel import Delay
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.matrices import RealMatrix

__all__ = ["collocation_sizes", "collocation_spectrum"]

_MOST_NODES = 1500


def collocation_sizes(spans: RealMatrix, frequency: float, n_states: int) -> list[int]:
    """Nodes per channel that resolve e^{s theta} up to |s| = `frequency` (rad/s), within a size that can be solved."""
    longest = spans.max(axis=0, initial=0.0)
    wanted = 0.5 * frequency * longest + 8
    room = max(_MOST_NODES - n_states, 50)
    return [max(4, ceil(size)) for size in wanted * min(1.0, room / max(wanted.sum(), 1.0))]


def collocation_spectrum(system: DelaySystem, spans: RealMatrix, sizes: list[int]) -> NDArray[np.complex128]:
    """Eigenvalues of the discretised system for each row of `spans` (k, m): (k, n + sum(sizes)).

    psi_i(theta, t) = z_i(t + theta), -span_i <= theta <= 0, d psi/dt = d psi/d theta at the nodes,
    psi_i(0) = z_i; a Delay reads psi(-tau), a Hold the mean of psi (Clenshaw-Curtis).
    Source: Breda, Maset & Vermiglio, SIAM J. Sci. Comput. 27 (2005) 482-495.
    """
    n, total = system.n_states, sum(sizes)
    place = np.cumsum([n, *sizes])
    at_zero, reads = np.zeros(system.n_channels), np.zeros((system.n_channels, n + total))
    for i, (channel, size) in enumerate(zip(system.channels, sizes, strict=True)):
        weights = np.eye(size + 1)[-1] if isinstance(channel, Delay) else _mean_weights(size)
        at_zero[i], reads[i, place[i] : place[i + 1]] = weights[0], weights[1:]
    driven = np.hstack([system.C2, np.zeros((system.n_channels, total))]) + system.D22 @ reads
    z = np.linalg.solve(np.eye(system.n_channels) - system.D22 * at_zero, driven)
    w = at_zero[:, None] * z + reads
    lines = np.zeros((total, n + total))
    for i, size in enumerate(sizes):
        rows, slope = slice(place[i] - n, place[i + 1] - n), _differentiation(size)[1:]
        lines[rows, place[i] : place[i + 1]] = slope[:, 1:]
        lines[rows] += slope[:, :1] * z[i]
    top = np.hstack([system.A, np.zeros((n, total))]) + system.B2 @ w
    rates = 2.0 / np.repeat(spans, sizes, axis=1)
    top_rows = np.broadcast_to(top, (len(spans), n, n + total))
    stack = np.concatenate([top_rows, rates[:, :, None] * lines], axis=1)
    return np.linalg.eigvals(stack).astype(complex)


def _nodes(size: int) -> RealMatrix:
    return np.cos(np.pi * np.arange(size + 1) / size)


def _differentiation(size: int) -> RealMatrix:
    """Derivative at the Chebyshev points cos(k pi/N), k = 0..N (Trefethen, Spectral Methods in MATLAB, ch. 6)."""
    x = _nodes(size)
    c = np.ones(size + 1)
    c[[0, -1]] = 2.0
    c *= (-1.0) ** np.arange(size + 1)
    difference = x[:, None] - x[None, :] + np.eye(size + 1)
    matrix = np.outer(c, 1.0 / c) / difference
    return matrix - np.diag(matrix.sum(axis=1))


def _mean_weights(size: int) -> RealMatrix:
    """Weights of the mean over the span at the Chebyshev points (exact for polynomials of degree N)."""
    degrees = np.arange(size + 1)
    moments = np.zeros(size + 1)
    moments[::2] = 1.0 / (1.0 - degrees[::2] ** 2.0)
    vandermonde = np.cos(np.outer(degrees, np.arccos(_nodes(size))))
    return np.linalg.solve(vandermonde, moments)
