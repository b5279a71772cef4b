"""How many multipliers lie outside the unit circle: the argument principle, beside the eigenvalues."""

import numpy as np

from delaytools.linear.matrices import RealMatrix
from delaytools.signals.trouble import AnalysisError

__all__ = ["count_outside"]

_MOST_POINTS = 200_000


def count_outside(monodromy: RealMatrix) -> int:
    """The number of eigenvalues z of Φ with |z| > 1: -(change of arg det(I - Φ/z) around |z| = 1)/2π.

    det(I - Φ/z) has all its poles at 0 and is 1 at infinity. Arcs are halved until the phase turns by less
    than 0.5 rad on each half. Raises AnalysisError where an eigenvalue lies on the circle.
    """
    angle = np.linspace(0.0, np.pi, 65)
    phase = _phase(monodromy, angle)
    while True:
        middle = 0.5 * (angle[:-1] + angle[1:])
        at = _phase(monodromy, middle)
        first, second = at / phase[:-1], phase[1:] / at
        rough = (np.abs(np.angle(first)) > 0.5) | (np.abs(np.angle(second)) > 0.5)
        if not rough.any():
            turned = float(np.angle(first).sum() + np.angle(second).sum())
            return round(-turned / np.pi)
        angle, phase = (
            np.insert(angle, np.flatnonzero(rough) + 1, middle[rough]),
            np.insert(phase, np.flatnonzero(rough) + 1, at[rough]),
        )
        if len(angle) > _MOST_POINTS or np.diff(angle).min() < 1e-12:
            raise AnalysisError("a characteristic root lies on the stability limit: it cannot be counted")


def _phase(monodromy: RealMatrix, angle: RealMatrix) -> np.ndarray:
    """det(I - Φ e^{-jθ}) / |det| for each θ."""
    shifted = np.eye(len(monodromy)) - monodromy * np.exp(-1j * angle)[:, None, None]
    return np.linalg.slogdet(shifted)[0]
