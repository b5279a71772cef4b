"""Is the closed loop around L stable: a count of its roots, never a reading of the margins."""

import numpy as np

from delaytools.analysis.characteristic_roots import unstable_count
from delaytools.linear.delay_system import DelaySystem
from delaytools.signals.trouble import AnalysisError

__all__ = ["closed_loop_of", "is_stable", "roots_not_left"]

MARGINAL = 1e-10  # a curve this near -1 has a root on the axis: not stable, and no count is asked for


def closed_loop_of(L: DelaySystem) -> DelaySystem:
    """u = e - y around L: the system e to y, whose characteristic roots are those of 1 + L = 0 (and hidden ones)."""
    unit = np.eye(1)
    return L.connected(-unit, into=unit, out=unit)


def roots_not_left(closed: DelaySystem) -> int:
    """The number of characteristic roots with Re s >= 0 (on the axis: within rounding).

    Eigenvalues where no delay is left, else the argument principle. Raises AnalysisError where no count
    could be certified.
    """
    closed = closed.without_zero_delays()
    if not closed.channels:
        poles = np.linalg.eigvals(closed.A) if closed.n_states else np.zeros(0)
        return int(np.sum(poles.real >= -1e-13 * np.abs(closed.A).max(initial=0.0)))
    found = unstable_count(closed)
    if not found.certified:
        raise AnalysisError("the unstable roots of the closed loop cannot be counted", found=found.why)
    return found.count + found.on_axis


def is_stable(L: DelaySystem, modulus_margin: float) -> bool:
    """Whether 1 + L(s) = 0 has no root in Re s >= 0, by count; False where the curve passes through -1."""
    return modulus_margin > MARGINAL and roots_not_left(closed_loop_of(L)) == 0
