"""Sets of roots: sorted, mirrored, without doubles, and with multiplicity where roots coincide."""

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.root_bounds import Box
from delaytools.analysis.root_newton import distinct, root_moments
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.matrices import RealMatrix

__all__ = ["gap_left_of", "mirrored", "sorted_roots", "with_multiplicity"]

ComplexArray = NDArray[np.complex128]
RootSet = tuple[ComplexArray, RealMatrix]

_SAME = 1e-8
_CLUSTER = 2e-3


def mirrored(roots: ComplexArray) -> ComplexArray:
    """The roots and the conjugates of those off the real axis."""
    return np.concatenate([roots, roots[roots.imag != 0].conj()])


def sorted_roots(roots: ComplexArray, steps: RealMatrix, box: Box) -> RootSet:
    """The distinct converged roots in the box with their conjugates, by decreasing real part, and their steps."""
    size = np.abs(roots) + 1e-3 / _length(box)
    converged = np.isfinite(roots) & (steps < 1e-5 * size)
    roots, steps, size = roots[converged], steps[converged], size[converged]
    real = np.abs(roots.imag) < 1e-9 * size
    roots = np.where(real, roots.real, np.where(roots.imag < 0, roots.conj(), roots))
    kept = distinct(roots, steps, _SAME * size)
    roots, steps = roots[kept], steps[kept]
    inside = (roots.real > box.left) & (roots.real < box.right) & (roots.imag < box.top)
    return _ordered(roots[inside], steps[inside])


def with_multiplicity(system: DelaySystem, found: RootSet, box: Box) -> RootSet:
    """Roots that crowd together replaced by their mean, as often as the argument principle counts there."""
    upper = found[0].imag >= 0
    roots, steps = found[0][upper], found[1][upper]
    scale = np.abs(roots) + 1e-3 / _length(box)
    taken = np.zeros(len(roots), dtype=bool)
    new_roots: list[complex] = []
    new_steps: list[float] = []
    for index, root in enumerate(roots):
        if taken[index]:
            continue
        members = ~taken & (np.abs(roots - root) < _CLUSTER * scale[index])
        taken |= members
        number, mean = _cluster(system, roots, members)
        new_roots += [mean] * number if number > members.sum() else list(roots[members])
        new_steps += [float(steps[members].max())] * max(number, int(members.sum()))
    return _ordered(np.array(new_roots, dtype=complex), np.array(new_steps))


def gap_left_of(roots: ComplexArray, count: int) -> float:
    """A line Re s = c in the gap left of the rightmost `count` roots."""
    levels = np.sort(roots.real)[::-1]
    if not len(levels):
        return -1.0
    scale = np.abs(roots).max() or 1.0
    for index in range(min(count, len(levels)) - 1, len(levels) - 1):
        gap = levels[index] - levels[index + 1]
        if gap > 1e-4 * scale:
            return float(levels[index] - 0.5 * gap)
    return float(levels[-1] - 0.05 * scale)


def _cluster(system: DelaySystem, roots: ComplexArray, members: NDArray[np.bool_]) -> tuple[int, complex]:
    """How many roots a circle about the members holds, others left out, and their mean."""
    centre = complex(roots[members].mean())
    spread = np.abs(roots[members] - centre).max()
    others = np.abs(np.concatenate([roots[~members], roots.conj()[roots.imag > 1e-6]]) - centre)
    clear = others[others > 0].min(initial=np.inf)
    radius = min(0.4 * clear, max(4 * spread, _CLUSTER * (abs(centre) + 1e-3)))
    number, mean = root_moments(system, centre, float(radius))
    real = abs(mean.imag) < 1e-9 * (abs(mean) + 1e-9)
    return round(number), complex(mean.real) if real else mean


def _ordered(roots: ComplexArray, steps: RealMatrix) -> RootSet:
    pairs = roots.imag != 0
    whole = np.concatenate([roots, roots[pairs].conj()])
    order = np.lexsort((-whole.imag, np.abs(whole.imag), -whole.real))
    return whole[order], np.concatenate([steps, steps[pairs]])[order]


def _length(box: Box) -> float:
    """A time (s) to compare small roots with: none is resolved far below the box."""
    return 1e3 / max(box.top, abs(box.left), 1e-300)
