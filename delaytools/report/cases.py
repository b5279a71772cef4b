"""What the report asks, and of which loops: the opening, the extra delay, one case for each configuration."""

from dataclasses import dataclass, replace
from typing import final

from delaytools.blocks.block import Sampled
from delaytools.blocks.delay import Delay
from delaytools.design.build import build, flight
from delaytools.design.design import Design
from delaytools.design.values import number
from delaytools.loop.loop import Loop
from delaytools.loop.values import resolve, value_paths
from delaytools.report.signal_graph import reachable, signal_graph

__all__ = ["AS_WRITTEN", "Asked", "Case", "asked", "cases", "same_loop", "without_present"]

AS_WRITTEN = "base design"


@final
@dataclass(frozen=True)
class Asked:
    """Where loops are opened, where an extra delay stands, over which delays (s), and what the design leaves out.

    at "" where no block lies on a feedback path. high None: twice the delay margin.
    """

    at: str
    delay_at: str | None
    low: float
    high: float | None
    missing: tuple[str, ...]

    @property
    def place(self) -> str:
        """Where the extra delay stands, in words."""
        return self.delay_at or self.at


@final
@dataclass(frozen=True)
class Case:
    """One configuration: its loop on the bench, and the loop that flies (None where [flight] removes nothing)."""

    name: str
    description: str
    loop: Loop
    flight: Loop | None


def asked(design: Design) -> Asked:
    """The design's [analysis], or what takes its place, with a sentence for everything that is left out."""
    table, loop = design.tables.analysis, build(design)
    missing = []
    at = table.at
    if at is None:
        at = _natural_opening(loop)
        instead = f"the loop is opened at {at}" if at else "no block lies on a feedback path"
        missing.append(f"[analysis] at is not given: {instead}.")
    if table.delay_at is None and at:
        missing.append(f"[analysis] delay_at is not given: the extra delay stands at {at}.")
    low, high = (0.0, None) if table.delay is None else (number(item, "s") for item in table.delay)
    if table.delay is None:
        missing.append("[analysis] delay is not given: delays run from 0 to twice the delay margin.")
    if not design.tables.inputs:
        missing.append("[inputs] is empty: nothing drives the loop, so no runs are shown.")
    if not design.tables.flight.remove:
        missing.append("[flight] remove is empty: the bench cannot be compared with the loop that flies.")
    if not design.tables.configurations:
        missing.append("[configurations] is empty: the loop is judged as written.")
    return Asked(at, table.delay_at, low or 0.0, high, tuple(missing))


def _natural_opening(loop: Loop) -> str:
    """The output of the last sampled block on a feedback path, else of the last block on one."""
    graph = signal_graph(loop)
    closed = [e for e in loop.elements if "@" not in e.name and e.name in reachable(graph, e.name)]
    chosen = [e for e in closed if isinstance(e.block, Sampled)] or closed
    return next(iter(chosen[-1].outputs.values())) if chosen else ""


def cases(design: Design) -> tuple[Case, ...]:
    """One case for each configuration, in the file's order; the design as written first, unless one equals it."""
    named = [_case(design, name, text) for name, text in design.configurations.items()]
    base = _case(design, None, "The design without a configuration")
    if any(same_loop(base.loop, case.loop) for case in named):
        return tuple(named)
    return (base, *named)


def _case(design: Design, name: str | None, description: str) -> Case:
    flies = flight(design, name) if design.tables.flight.remove else None
    return Case(name or AS_WRITTEN, description, build(design, name), flies)


def same_loop(first: Loop, second: Loop) -> bool:
    """Whether both loops have the same elements, and the same value at every path."""
    return _key(first) == _key(second)


def _key(loop: Loop) -> tuple[object, ...]:
    names = tuple((e.name, type(e.block), tuple(p.name for p in e.modifiers)) for e in resolve(loop).elements)
    return names, tuple(sorted(value_paths(loop).items()))


def without_present(loop: Loop, delay_at: str | None) -> tuple[Loop, float]:
    """The loop with the delay block at the port set to 0 s, and the delay (s) that it had.

    So a sweep of extra delay becomes one of the whole delay at that place; a port of any other block keeps its
    loop, with 0 s present.
    """
    name = (delay_at or "").partition(".")[0]
    for element in resolve(loop).elements:
        if element.name == name and isinstance(element.block, Delay):
            zeroed = replace(loop[name], block=replace(element.block, delay=0.0))
            return loop.replaced(zeroed), float(element.block.delay)
    return loop, 0.0
