"""The gains for which a closed loop is stable: crossings say where it may change, a count says what lies between."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from delaytools.analysis.margins import Crossing

__all__ = ["GAINS", "stable_gains"]

GAINS = (0.01, 100.0)  # beyond, the curve was not followed: crossings of |L| < 0.01 are not all known
_SAME = 1e-9


def stable_gains(
    crossings: Sequence[Crossing], stable_at: Callable[[float], bool], limits: tuple[float, float] = GAINS
) -> tuple[tuple[float, float], ...]:
    """The intervals of the factor k within `limits` for which the loop closed around k L is stable.

    crossings: those of L; a root is on the axis just where k = 1/|L| at a phase crossing, at ω = 0 and ω → ∞ too.
    stable_at(k): the verdict of a count, asked once between two of these. Inner ends are exact.
    """
    low, high = limits
    edges = sorted(c.margin for c in crossings if c.kind == "phase" and low < c.margin < high)
    kept = [low]
    for edge in [*edges, high]:
        if edge > kept[-1] * (1 + _SAME):
            kept.append(edge)
    found: list[tuple[float, float]] = []
    for a, b in pairwise(kept):
        if not stable_at(float(np.sqrt(a * b))):
            continue
        if found and found[-1][1] == a:  # roots that touch the axis, or cross it elsewhere, end nothing
            a = found.pop()[0]
        found.append((a, b))
    return tuple(found)
