"""What a case is made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Planted:
    """One effect of the truth: what, where, how much, and the measured signals at which it shows (first = named)."""

    effect: str
    port: str
    parameters: Mapping[str, float]
    exits: tuple[str, ...]
    source: str | None = None
    judged: tuple[str, ...] = ()


@dataclass(frozen=True)
class Lane:
    """One run of the simulator: true block values, effects, and the lane whose measured signals drive it.

    parent None: a loop of its own. Otherwise a shadow: every segment is driven by the parent's measured signals.
    """

    values: Mapping[str, float]
    effects: Sequence[Planted]
    externals: Mapping[str, Array]
    noise: Mapping[str, Array] = field(default_factory=dict)
    noise_first: bool = False
    draws: Array | None = None
    parent: int | None = None


@dataclass(frozen=True)
class Acts:
    """What acts inside a block in one lane: forces at its derivatives, and a limit on its rate."""

    forces: tuple[tuple[str, str, Mapping[str, float]], ...]
    rate_limit: float
    smoothing: float

    @property
    def any(self) -> bool:
        """Something acts."""
        return bool(self.forces) or np.isfinite(self.rate_limit)

    @property
    def rubs(self) -> bool:
        """A friction is among the forces."""
        return any("friction" in kind for _, kind, _ in self.forces)

    def uses(self, port: str) -> bool:
        """Something acts at this derivative."""
        return any(place == port for place, _, _ in self.forces)

    def at(self, port: str) -> list[tuple[str, Mapping[str, float]]]:
        """The forces at this derivative."""
        return [(kind, values) for place, kind, values in self.forces if place == port]
