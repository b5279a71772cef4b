"""A loop cut at its measured signals: pieces that each run from what was measured at their entries alone."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import final

from delaytools.loop.edit import cut, reader
from delaytools.loop.loop import Element, Loop
from delaytools.loop.port import Port
from delaytools.signals.trouble import DesignError

__all__ = ["Segment", "segments"]


@final
@dataclass(frozen=True)
class Segment:
    """The part of a loop between measured signals.

    exits: measured signals that it writes, in signal order. loop: its elements alone; what it reads from outside is
    an external input, and a reading of its own exit stands there as `reader(exit)`.
    """

    exits: tuple[str, ...]
    loop: Loop

    @property
    def name(self) -> str:
        """The first exit: the signal at which what happens here is said to show."""
        return self.exits[0]

    @property
    def entries(self) -> tuple[str, ...]:
        """External signals that drive it, as a log names them."""
        own = {reader(exit): exit for exit in self.exits}
        return tuple(own.get(name, name) for name in self.loop.externals)

    @property
    def blocks(self) -> tuple[str, ...]:
        """Names of the design's blocks in it, effects left out."""
        return tuple(element.name for element in self.loop.elements if "@" not in element.name)

    def ahead_of_exit(self, at: str) -> float:
        """How far a port, or a block, is ahead of the nearest exit: blocks between, and a half more inside a block."""
        name, _, port = at.partition(".")
        writers, blocks = self.loop.writers, 0
        level, seen = {writers[exit][0] for exit in self.exits}, set[str]()
        while level and name not in level:
            seen |= level
            read = (signal for one in level for signal in _reads(self.loop[one], self.loop))
            level, blocks = {writers[signal][0] for signal in read if signal in writers} - seen, blocks + 1
        return blocks + (0.0 if port in self.loop[name].outputs else 0.5)

    def holds(self, port: Port) -> bool:
        """Whether the port's block lies in this segment."""
        return port.element in self.blocks


def segments(loop: Loop, measured: Collection[str]) -> tuple[Segment, ...]:
    """The loop cut at the measured signals, upstream first where the design names them so.

    Exits whose ways share a block with states stay in one segment. Blocks that lead to no measured signal are in no
    segment. Raises DesignError where no block writes a measured signal.
    """
    written = [name for name in loop.signals if name in measured and name in loop.writers]
    if not written:
        raise DesignError(
            "no measured signal is written by a block of the design",
            found=", ".join(sorted(measured)) or "no columns",
            known=[name for name in loop.signals if name in loop.writers],
            advice="name the log's columns as the design's signals, or map them under [log]",
        )
    ways = {name: _upstream(loop, name, set(measured)) for name in written}
    groups: list[tuple[list[str], set[str]]] = []
    for name in written:
        touching = [group for group in groups if group[1] & ways[name]]
        merged = ([*(s for g in touching for s in g[0]), name], ways[name].union(*(g[1] for g in touching)))
        groups = [group for group in groups if group not in touching] + [merged]
    order = {name: index for index, name in enumerate(written)}
    found = [_segment(loop, sorted(exits, key=order.__getitem__), names) for exits, names in groups]
    return tuple(sorted(found, key=lambda segment: order[segment.name]))


def _upstream(loop: Loop, signal: str, measured: set[str]) -> set[str]:
    """Names of the elements between the signal and the measured signals before it."""
    writers = loop.writers
    waiting, found = [writers[signal][0]], set()
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found.add(name)
        for read in _reads(loop[name], loop):
            if read not in measured and read in writers:
                waiting.append(writers[read][0])
    return found


def _reads(element: Element, loop: Loop) -> Iterable[str]:
    for expression in element.inputs.values():
        yield from (name for name in expression.names if name not in loop.parameters)
    for placed in element.modifiers:
        yield from placed.read


def _segment(loop: Loop, exits: list[str], names: set[str]) -> Segment:
    part = replace(loop, elements=tuple(element for element in loop.elements if element.name in names))
    for exit in exits:
        if exit in part.read:
            part = cut(part, exit)
    return Segment(tuple(exits), part)
