"""A loop: blocks in their places, wired by signal names."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, final

from delaytools.blocks.block import Block, Continuous, Sampled, Transport
from delaytools.loop.modifier import Modifier
from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError

__all__ = ["Element", "Loop", "Placed"]


@final
@dataclass(frozen=True)
class Placed:
    """A modifier in its place; `path` is where its values stand in the design (`effects.0`).

    instead: signal that the modifier asks for -> signal that it reads (where a loop is opened). seen: state of its
    block -> signal that it sees in that state's stead.
    """

    modifier: Modifier
    name: str
    path: str
    instead: Mapping[str, str] = field(default_factory=dict)
    seen: Mapping[str, str] = field(default_factory=dict)

    @property
    def sources(self) -> tuple[str, ...]:
        """Signals that the modifier asks for, under the names of what it reads."""
        return tuple(self.instead.get(name, name) for name in self.modifier.sources)

    @property
    def read(self) -> tuple[str, ...]:
        """Every signal that it reads."""
        return (*self.sources, *self.seen.values())


@final
@dataclass(frozen=True)
class Element:
    """A block in its place.

    inputs: port -> linear combination of signals. outputs: port -> signal. path: where its values stand in the
    design (the block's name, or `effects.0`). amplitude_dependent: left out of linear analysis.
    """

    name: str
    block: Block
    inputs: Mapping[str, Expression]
    outputs: Mapping[str, str]
    path: str = ""
    modifiers: tuple[Placed, ...] = ()
    amplitude_dependent: bool = False

    def __post_init__(self) -> None:
        if not self.path:
            object.__setattr__(self, "path", self.name)


@final
@dataclass(frozen=True)
class Loop:
    """Elements wired by signal names, with the named numbers that their values may use.

    parameters: name -> number or formula of other parameters. units: signal -> unit. frame: s.
    random: signal -> kind of draw ("uniform"), for signals that the simulation draws from its seed. moment: s, at which
    linear analysis takes what depends on time.
    """

    elements: tuple[Element, ...]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    frame: float = 1e-3
    title: str = ""
    random: Mapping[str, str] = field(default_factory=dict)
    moment: float = 0.0

    def __getitem__(self, name: str) -> Element:
        for element in self.elements:
            if element.name == name:
                return element
        known = [element.name for element in self.elements]
        raise DesignError("unknown block", found=repr(name), known=known)

    def replaced(self, element: Element) -> "Loop":
        """The loop with the element of that name replaced."""
        return replace(self, elements=tuple(element if e.name == element.name else e for e in self.elements))

    @property
    def writers(self) -> dict[str, tuple[str, str]]:
        """signal -> (element, port) that writes it."""
        return {s: (e.name, port) for e in self.elements for port, s in e.outputs.items()}

    @property
    def read(self) -> tuple[str, ...]:
        """Every signal that something reads, in order of first reading."""
        found: dict[str, None] = {}
        for element in self.elements:
            for expression in element.inputs.values():
                found.update(dict.fromkeys(n for n in expression.names if n not in self.parameters))
            for placed in element.modifiers:
                found.update(dict.fromkeys(placed.read))
        return tuple(found)

    @property
    def externals(self) -> tuple[str, ...]:
        """Signals that are read and that no block writes."""
        written = self.writers
        return tuple(name for name in self.read if name not in written)

    @property
    def signals(self) -> tuple[str, ...]:
        """Every signal that the design names: external inputs first, then what blocks write."""
        named = (*self.externals, *(s for e in self.elements for s in e.outputs.values()))
        return tuple(s for s in dict.fromkeys(named) if "." not in s and "@" not in s)

    @property
    def continuous(self) -> tuple[Element, ...]:
        """Elements with the continuous nature."""
        return tuple(e for e in self.elements if isinstance(e.block, Continuous))

    @property
    def sampled(self) -> tuple[Element, ...]:
        """Elements with the sampled nature."""
        return tuple(e for e in self.elements if isinstance(e.block, Sampled))

    @property
    def transports(self) -> tuple[Element, ...]:
        """Elements that delay their input."""
        return tuple(e for e in self.elements if isinstance(e.block, Transport))
