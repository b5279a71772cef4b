"""Two candidates at once: two forces on one mass, where each alone would take another's place."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import specifications
from delaytools.design.catalogue import EFFECTS
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.screen import Base, Screened, response

__all__ = ["pairs"]

Array = NDArray[np.float64]
# kinds whose change grows with one value as it is, at least about a finite one
SCALED = {
    "bias": "level", "scale_factor": "factor", "gain_drift": "rate", "constant_disturbance": "level",
    "cubic_damping": "coefficient", "quadratic_drag": "coefficient", "cubic_stiffness": "coefficient",
    "coulomb_friction": "level", "load_dependent_friction": "coefficient", "cross_coupling": "gain",
}  # fmt: skip
LEFT_OUT = ("flexible_mode", "periodic_interference", "transient_gain")  # with another one they imitate too much
MOST = 12  # candidates that are combined
KEPT = 2
REACH = (0.05, 5.0)  # scales of candidates that do not grow with one value
WORTH = 100.0  # χ² that two must take off beyond the best one alone


def pairs(base: Base, found: Sequence[Screened], *, least: float) -> list[tuple[tuple[Added, Added], float]]:
    """The pairs that take most off, with their χ², where that is more than the best candidate takes alone.

    least: χ² that a single one is known to take off when it is fitted.
    """
    own = []
    for one in [s for s in found if s.added.kind not in LEFT_OUT][:MOST]:
        change = response(base, one.added)
        if change is not None and (rows := base.projected(change)) @ rows > 0:
            own.append((one.added, rows))
    if len(own) < 2:
        return []
    alone = max(least, *(float(rows @ base.residual) ** 2 / float(rows @ rows) for _, rows in own))
    both = [pair for one, other in combinations(own, 2) if (pair := _pair(base, one, other)) is not None]
    worth = [pair for pair in both if pair[1] - alone > WORTH]
    return sorted(worth, key=lambda pair: -pair[1])[:KEPT]


def _pair(
    base: Base, one: tuple[Added, Array], other: tuple[Added, Array]
) -> tuple[tuple[Added, Added], float] | None:
    """Both at their best scales, and the χ² that they take off."""
    if one[0].kind == other[0].kind:
        return None
    columns = np.stack([one[1], other[1]], axis=1)
    right = columns.T @ base.residual
    square = columns.T @ columns
    if abs(square[0, 1]) > 0.9999 * np.sqrt(square[0, 0] * square[1, 1]):
        return None
    scales = np.linalg.solve(square, right)
    first, second = (_at(part, float(scale)) for part, scale in zip((one[0], other[0]), scales, strict=True))
    return None if first is None or second is None else ((first, second), float(scales @ right))


def _at(one: Added, scale: float) -> Added | None:
    """The candidate with its change scaled; None where it cannot be."""
    name = SCALED.get(one.kind)
    if name is None:
        return one if REACH[0] < scale < REACH[1] else None
    spec = specifications(EFFECTS[one.kind])[name]
    neutral = spec.neutral or 0.0
    value = neutral + scale * (one.values[name] - neutral)
    if not spec.allows(value):
        return None
    return one.moved({name: value})
