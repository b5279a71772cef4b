"""Guesses made roots: Newton on the exact characteristic matrix, for many guesses and many delays at once."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.evaluation import bordered_derivative, bordered_matrix, solved
from delaytools.linear.matrices import RealMatrix

__all__ = ["distinct", "newton", "root_moments"]

ComplexArray = NDArray[np.complex128]
_STEPS = 25
_CIRCLE_POINTS = 64


def newton(system: DelaySystem, guesses: ComplexArray, spans: RealMatrix) -> tuple[ComplexArray, RealMatrix]:
    """Roots from `guesses` (k,) with their spans (k, m), and the last Newton step of each, rad/s.

    s <- s - 1/trace(M(s)^-1 M'(s)), which is Newton on det M; the last step estimates the root's error.
    """
    s, step = guesses.copy(), np.full(guesses.shape, np.inf)
    reach = 1.0 / np.maximum(spans.max(axis=1, initial=0.0), 1e-9)
    active = np.arange(len(s))
    for _ in range(_STEPS):
        if not len(active):
            break
        move = _newton_step(system, s[active], spans[active])
        limit = np.maximum(2 * reach[active], 0.5 * np.abs(s[active]))
        size = np.abs(move)
        with np.errstate(invalid="ignore"):  # a guess from which no step is finite
            s[active] = s[active] + move * np.minimum(1.0, limit / np.maximum(size, 1e-30))
        done = size < 4e-15 * np.abs(s[active])
        stalled = (size < 1e-9 * np.abs(s[active])) & (size >= 0.3 * step[active])
        step[active] = size
        active = active[~(done | stalled | ~np.isfinite(s[active]))]
    return s, step


def root_moments(system: DelaySystem, centre: complex, radius: float) -> tuple[float, complex]:
    """The number of roots in a circle, and their mean: (1/2 pi i) times the integrals of f'/f and s f'/f."""
    turn = np.exp(2j * np.pi * (np.arange(_CIRCLE_POINTS) + 0.5) / _CIRCLE_POINTS)
    spans = np.broadcast_to(np.array(system.delays), (_CIRCLE_POINTS, system.n_channels))
    density = _log_derivative(system, centre + radius * turn, spans) * radius * turn / _CIRCLE_POINTS
    number = density.sum()
    offset = (density * radius * turn).sum() / number if abs(number) > 0.5 else 0.0
    return float(number.real), complex(centre + offset)


def distinct(roots: ComplexArray, steps: RealMatrix, tolerance: RealMatrix) -> NDArray[np.int64]:
    """Indices of the roots left when those nearer than `tolerance` (rad/s, each) to a better one are dropped."""
    order = np.argsort(steps, kind="stable")
    sorted_roots = roots[order]
    close = np.abs(sorted_roots[:, None] - sorted_roots[None, :]) <= tolerance[order][:, None]
    repeated = np.any(np.tril(close, -1), axis=1)
    return order[~repeated]


def _newton_step(system: DelaySystem, s: ComplexArray, spans: RealMatrix) -> ComplexArray:
    """-1/(d/ds log det M); a point where M is exactly singular steps from beside it, nan where that fails."""
    slope = _log_derivative(system, s, spans)
    singular = ~np.isfinite(slope)
    aside = np.where(singular, 1e-13 * (np.abs(s) + 1e-3 * np.max(np.abs(s), initial=1e-3)), 0.0)
    if singular.any():
        slope[singular] = _log_derivative(system, (s + aside)[singular], spans[singular])
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        return np.where(np.isfinite(slope), aside - 1.0 / slope, np.nan)


def _log_derivative(system: DelaySystem, s: ComplexArray, spans: Any) -> ComplexArray:
    """d/ds log det M(s) = trace(M^-1 M'), the rows of M scaled where Re s < 0; not finite where M is singular."""
    ratio = solved(bordered_matrix(system, s, spans), bordered_derivative(system, s, spans))
    return np.trace(ratio, axis1=-2, axis2=-1)
