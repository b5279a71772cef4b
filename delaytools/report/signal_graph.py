"""Who reads whom: the elements of a loop as a directed graph, and its ways round."""

from collections.abc import Iterable, Mapping
from typing import Any

from delaytools.loop.loop import Loop
from delaytools.loop.values import parameter_values
from delaytools.signals.expression import Expression

__all__ = ["Graph", "longest_cycle", "on_cycles", "on_every_cycle", "reachable", "signal_graph", "strays"]

Graph = Mapping[str, tuple[str, ...]]
_STEPS = 50_000  # ways tried before the longest cycle found so far is taken


def signal_graph(loop: Loop) -> dict[str, tuple[str, ...]]:
    """element -> the elements that read one of its outputs, with a factor other than 0, in the loop's order."""
    numbers = parameter_values(loop, {})
    writers = {signal: name for signal, (name, _) in loop.writers.items()}
    found: dict[str, dict[str, None]] = {element.name: {} for element in loop.elements}
    for element in loop.elements:
        names = [n for expression in element.inputs.values() for n in _read(expression, numbers)]
        names += [n for placed in element.modifiers for n in placed.modifier.sources]
        for name in names:
            if name in writers:
                found[writers[name]].setdefault(element.name)
    return {name: tuple(readers) for name, readers in found.items()}


def _read(expression: Expression, numbers: Mapping[str, Any]) -> list[str]:
    """The signals of a linear combination whose factor is not 0."""
    names = [n for n in expression.names if n not in numbers]
    rest = {**numbers, **dict.fromkeys(names, 0.0)}
    return [n for n in names if float(expression.evaluate({**rest, n: 1.0})) != 0.0]


def reachable(graph: Graph, start: str, without: Iterable[str] = ()) -> set[str]:
    """The elements that a signal from `start` reaches; `start` itself only where a way leads back."""
    closed, waiting, found = set(without), list(graph.get(start, ())), set()
    while waiting:
        name = waiting.pop()
        if name not in found and name not in closed:
            found.add(name)
            waiting.extend(graph.get(name, ()))
    return found


def on_cycles(graph: Graph, start: str) -> set[str]:
    """The elements that lie on a way from `start` back to `start`."""
    forward = reachable(graph, start)
    if start not in forward:
        return set()
    return {name for name in forward if start in reachable(graph, name) or name == start}


def on_every_cycle(graph: Graph, start: str) -> set[str]:
    """The elements that every way from `start` back to `start` passes: the series part of the loop."""
    candidates = on_cycles(graph, start)
    return {name for name in candidates if name == start or start not in reachable(graph, start, (name,))}


def longest_cycle(graph: Graph, start: str) -> tuple[str, ...]:
    """The longest way from `start` back to it that passes no element twice; empty where there is none."""
    return _longest(graph, start, on_cycles(graph, start), back=True)


def strays(graph: Graph, start: str, among: set[str]) -> tuple[str, ...]:
    """The longest way that begins at `start` and stays among the given elements."""
    return _longest(graph, start, among, back=False) or (start,)


def _longest(graph: Graph, start: str, among: set[str], *, back: bool) -> tuple[str, ...]:
    best: tuple[str, ...] = ()
    stack: list[tuple[str, ...]] = [(start,)] if start in among else []
    steps = 0
    while stack and steps < _STEPS:
        way = stack.pop()
        steps += 1
        ends = start in graph.get(way[-1], ()) if back else True
        if ends and len(way) > len(best):
            best = way
        stack.extend((*way, name) for name in graph.get(way[-1], ()) if name in among and name not in way)
    return best
