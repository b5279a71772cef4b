"""The gains for which a closed loop is stable: crossings say where it may change, a count says what lies between."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np

from delaytools.analysis.margins import Crossing

__all__ = ["GAINS", "GainWindows", "stable_gains"]

GAINS = (0.01, 100.0)  # beyond, the curve was not followed: crossings of |L| < 0.01 are not all known
_SAME = 1e-9
_MOST = 24  # crossings on either side of 1: a loop that comes back to itself directly has them without end


@final
@dataclass(frozen=True)
class GainWindows:
    """stable: the intervals of the factor k within `looked_at` for which the loop closed around k L is stable."""

    stable: tuple[tuple[float, float], ...]
    looked_at: tuple[float, float]


def stable_gains(
    crossings: Sequence[Crossing], stable_at: Callable[[float], bool], limits: tuple[float, float] = GAINS
) -> GainWindows:
    """Where between the limits, or the 24 crossings nearest to 1 on either side, a loop is stable.

    crossings: those of L; a root is on the axis just where k = 1/|L| at a phase crossing, at ω = 0 and ω → ∞ too.
    stable_at(k): the verdict of a count, asked once between two of these. Inner ends are exact.
    """
    edges = sorted({c.margin for c in crossings if c.kind == "phase" and limits[0] < c.margin < limits[1]})
    below, above = [k for k in edges if k <= 1][-_MOST - 1 :], [k for k in edges if k > 1][: _MOST + 1]
    low = below.pop(0) if len(below) > _MOST else limits[0]
    high = above.pop() if len(above) > _MOST else limits[1]
    kept = [low]
    for edge in [*below, *above, high]:
        if edge > kept[-1] * (1 + _SAME):
            kept.append(edge)
    found: list[tuple[float, float]] = []
    for a, b in pairwise(kept):
        if not stable_at(float(np.sqrt(a * b))):
            continue
        if found and found[-1][1] == a:  # roots that touch the axis, or cross it elsewhere, end nothing
            a = found.pop()[0]
        found.append((a, b))
    return GainWindows(tuple(found), (low, high))
