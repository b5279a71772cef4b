"""What acts on the derivative of a state: forces, friction, limits of an element's own speed."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, final

from delaytools.blocks.block import Scalar

__all__ = ["FORCE", "FRICTION", "LIMIT", "Modifier", "StateView"]

FORCE, FRICTION, LIMIT = 0, 1, 2


@final
@dataclass(frozen=True)
class StateView:
    """What a modifier sees of its block: time, states, derivatives so far, and the signals it asked for.

    position: the state whose derivative is the state acted on ("" where there is none).
    load: the derivative's terms that are no friction.
    """

    t: Scalar
    states: Mapping[str, Scalar]
    rates: Mapping[str, Scalar]
    position: str
    load: Scalar
    sources: tuple[Scalar, ...]


class Modifier(ABC):
    """Changes derivatives of one block's states; all forces act first, then friction, then limits."""

    stage: ClassVar[int]
    state: str

    @property
    @abstractmethod
    def sources(self) -> tuple[str, ...]:
        """Signals that the modifier reads."""

    @property
    @abstractmethod
    def amplitude_dependent(self) -> bool:
        """Whether linear analysis takes it at its neutral value."""

    @abstractmethod
    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        """New derivatives, for the states whose derivative changes."""
