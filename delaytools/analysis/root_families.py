"""The closed loop's roots against a delay or a gain, as families that loci can be drawn of."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from delaytools.analysis.characteristic_roots import rightmost_roots
from delaytools.analysis.root_newton import newton
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.lifted import LiftedSystem
from delaytools.linear.lifted_certificate import count_outside
from delaytools.signals.trouble import AnalysisError

__all__ = ["ContinuousFamily", "SampledFamily"]

ComplexArray = NDArray[np.complex128]
ASIDE = 0.05  # of their spread: how far left of roots a line lies
FAR = 1e3  # for z: no eigenvalue to take; not so far that the others' distances are lost beside it
SMALLEST = 0.01  # |z| down to which a line is laid by itself: eigenvalues nearer 0 are a cluster known badly
CONVERGED = 1e-9  # of a root's size: the last Newton step


@final
@dataclass(frozen=True, eq=False)
class ContinuousFamily:
    """Roots s of a closed system with delay for each value of a parameter; points are s itself."""

    closed: Callable[[float], DelaySystem]

    def counted(self, value: float, line: float) -> tuple[ComplexArray, str]:
        """All roots right of the line, certified by a count."""
        found = rightmost_roots(self.closed(value), right_of=line)
        return found.roots[found.roots.imag >= 0], "" if found.certified else found.why

    def line(self, value: float, count: int) -> float:
        """Re s left of the rightmost `count` roots, rad/s."""
        found = rightmost_roots(self.closed(value), count=count)
        levels = found.roots.real[:count]
        return found.right_of if np.isfinite(found.right_of) else _left_of(levels)

    def corrected(self, value: float, guesses: ComplexArray) -> tuple[ComplexArray, NDArray[np.bool_]]:
        """By Newton's method on the characteristic matrix."""
        system = self.closed(value).without_zero_delays()
        spans = np.tile(np.array(system.delays, dtype=float), (len(guesses), 1))
        roots, steps = newton(system, guesses, spans.reshape(len(guesses), system.n_channels))
        good = np.isfinite(roots) & (steps <= CONVERGED * (np.abs(roots) + np.abs(guesses)))
        return np.where(guesses.imag == 0, roots.real, roots), good

    def s(self, points: ComplexArray) -> ComplexArray:
        """The points themselves."""
        return points


@final
@dataclass(frozen=True, eq=False)
class SampledFamily:
    """Roots of an exact sampled loop for each value of a parameter; points are z = e^{s period}, the eigenvalues of its
    monodromy."""

    lifted: Callable[[float], LiftedSystem]
    period: float

    def counted(self, value: float, line: float) -> tuple[ComplexArray, str]:
        """All z outside the circle |z| = e^{line period}, certified by the argument principle on it."""
        system, radius = self.lifted(value), float(np.exp(line * self.period))
        z = system.multipliers
        outside = z[np.abs(z) > radius]
        try:
            counted = count_outside(system.monodromy / radius)
        except AnalysisError as error:
            return outside[outside.imag >= 0], error.problem
        words = f"{len(outside)} eigenvalues right of the line, {counted} counted"
        return outside[outside.imag >= 0], "" if counted == len(outside) else words

    def line(self, value: float, count: int) -> float:
        """Re s left of the rightmost `count` roots, rad/s."""
        s = self.lifted(value).roots(smallest=SMALLEST)
        return _left_of(s.real[:count])

    def corrected(self, value: float, guesses: ComplexArray) -> tuple[ComplexArray, NDArray[np.bool_]]:
        """The eigenvalues that lie nearest, each taken once; real ones for real guesses."""
        z = self.lifted(value).multipliers
        apart = np.abs(guesses[:, None] - z[None, :])
        apart[(guesses.imag == 0)[:, None] & (z.imag != 0)[None, :]] = np.inf
        apart = np.minimum(apart, FAR)
        rows, columns = linear_sum_assignment(apart)
        found, good = guesses.copy(), np.zeros(len(guesses), dtype=bool)
        found[rows], good[rows] = z[columns], apart[rows, columns] < FAR
        return found, good

    def s(self, points: ComplexArray) -> ComplexArray:
        """log(z)/period, in the primary strip."""
        return np.asarray(np.log(points) / self.period, dtype=complex)


def _left_of(levels: NDArray[np.float64]) -> float:
    """A line left of roots with these real parts."""
    if not len(levels):
        return -1.0
    return float(levels.min() - ASIDE * max(np.ptp(levels), abs(levels.min()), 1e-3))
