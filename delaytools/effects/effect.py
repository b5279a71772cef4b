"""What an effect is: Loop → Loop at one port, with values, neutral values, and knowledge in plain words."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, final

from delaytools.blocks.block import Block
from delaytools.loop.edit import act, insert
from delaytools.loop.loop import Element, Loop, Placed
from delaytools.loop.modifier import Modifier
from delaytools.loop.port import Port
from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError

__all__ = ["Effect", "Knowledge", "Place", "act_at", "check_place", "insert_at"]


@final
@dataclass(frozen=True)
class Knowledge:
    """What an engineer should know of an effect.

    what: the effect in one sentence. cause: where it comes from on a bench. margins: what it does to stability.
    check: how to see it on the bench.
    """

    what: str
    cause: str
    margins: str
    check: str


@final
@dataclass(frozen=True)
class Place:
    """Where an effect goes: a port, the name it will have (`TYPE@PORT`), and its path in the design."""

    port: Port
    name: str
    path: str


class Effect(ABC):
    """Something reality has and the design may lack.

    acts_on: kinds of port where it can act ("input", "output", "derivative", "rate", "block").
    amplitude_dependent: linear analysis takes it at its neutral value.
    """

    kind: ClassVar[str]
    acts_on: ClassVar[tuple[str, ...]]
    amplitude_dependent: ClassVar[bool]
    knowledge: ClassVar[Knowledge]

    @abstractmethod
    def apply(self, loop: Loop, place: Place) -> Loop:
        """The loop with the effect at the place."""


def check_place(effect: Effect, place: Place) -> None:
    """Raises DesignError where the effect cannot act at this kind of port."""
    if place.port.kind not in effect.acts_on:
        raise DesignError(
            f"{effect.kind} cannot act here",
            where=str(place.port),
            found=f"a port of kind {place.port.kind}",
            known=effect.acts_on,
            advice="choose a port of one of these kinds",
        )


def insert_at(
    loop: Loop, place: Place, effect: Effect, block: Block, *, sources: dict[str, Expression] | None = None
) -> Loop:
    """The loop with the effect's block in the wire at the place."""
    element = Element(place.name, block, {}, {}, place.path, (), effect.amplitude_dependent)
    return insert(loop, place.port, block, element=element, sources=sources)


def act_at(loop: Loop, place: Place, modifier: Modifier) -> Loop:
    """The loop with the modifier on the derivative at the place."""
    return act(loop, place.port, Placed(modifier, place.name, place.path))
