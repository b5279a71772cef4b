"""Wires between pins: along vertical channels between columns and horizontal channels between rows."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from delaytools.report.diagram_grid import Grid
from delaytools.report.diagram_parts import Part

__all__ = ["Pin", "Routed", "Tracks", "route"]

Point = tuple[float, float]


@final
@dataclass(frozen=True)
class Pin:
    """Where a signal leaves ("out") or enters ("in") a block; channel: the vertical channel it faces."""

    block: str
    signal: str
    kind: str
    x: float
    y: float
    channel: int
    row: int
    sign: int
    port: str
    x_side: int = 1


@final
@dataclass(frozen=True)
class Routed:
    """One signal's wire: a line of points for each reader, the joints where lines part, the readers' pins."""

    signal: str
    lines: tuple[tuple[Point, ...], ...]
    joints: tuple[Point, ...]
    readers: tuple[Pin, ...]


@final
@dataclass(frozen=True)
class Tracks:
    """Which signals run in each vertical channel (left of column c) and each horizontal one (above row r)."""

    vertical: Mapping[int, tuple[str, ...]]
    horizontal: Mapping[int, tuple[str, ...]]

    @staticmethod
    def of(parts: tuple[Part, ...], grid: Grid) -> "Tracks":
        """The tracks that the parts' wires need."""
        vertical: dict[int, dict[str, None]] = {}
        horizontal: dict[int, dict[str, None]] = {}
        for source in parts:
            begin = grid.cells[source.name]
            leaving = begin.column + int(begin.forward)
            for signal in source.outputs:
                for reader in parts:
                    if signal not in {e.signal for e in reader.entries}:
                        continue
                    end = grid.cells[reader.name]
                    entering = end.column + int(not end.forward)
                    if _is_straight(source, begin, reader, end):
                        continue
                    vertical.setdefault(leaving, {}).setdefault(signal)
                    if entering != leaving:
                        vertical.setdefault(entering, {}).setdefault(signal)
                        horizontal.setdefault(lane_between(begin.row, end.row, begin.forward), {}).setdefault(
                            signal
                        )
        return Tracks(
            {key: tuple(found) for key, found in vertical.items()},
            {key: tuple(found) for key, found in horizontal.items()},
        )


def _is_straight(source: Part, begin: object, reader: Part, end: object) -> bool:
    row, column, forward = begin.row, begin.column, begin.forward  # type: ignore[attr-defined]
    step = 1 if forward else -1
    next_to = (end.row, end.column, end.forward) == (row, column + step, forward)  # type: ignore[attr-defined]
    return next_to and len(source.outputs) == 1


def lane_between(first: int, second: int, forward: bool) -> int:
    """The horizontal channel for a wire from one row to another: beneath the upper; within a row, away from names."""
    return first + int(forward) if first == second else min(first, second) + 1


def route(
    source: Pin,
    readers: list[Pin],
    tracks: Tracks,
    places: tuple[Mapping[tuple[int, str], float], Mapping[tuple[int, str], float]],
) -> Routed:
    """The wire of one signal to all its readers."""
    channels, lanes = places
    lines: list[tuple[Point, ...]] = []
    for pin in readers:
        straight = pin.channel == source.channel and abs(pin.y - source.y) < 0.01
        if straight:
            lines.append(((source.x, source.y), (pin.x, pin.y)))
            continue
        x0 = channels[source.channel, source.signal]
        line: list[Point] = [(source.x, source.y), (x0, source.y)]
        if pin.channel == source.channel:
            line.append((x0, pin.y))
        else:
            y = lanes[lane_between(source.row, pin.row, source.x_side > 0), source.signal]
            x1 = channels[pin.channel, source.signal]
            line += [(x0, y), (x1, y), (x1, pin.y)]
        lines.append((*line, (pin.x, pin.y)))
    return Routed(source.signal, tuple(lines), _joints(lines), tuple(readers))


def _joints(lines: list[tuple[Point, ...]]) -> tuple[Point, ...]:
    """Where two lines from the same source part: the last point they share."""
    found: dict[Point, None] = {}
    for i, first in enumerate(lines):
        for second in lines[:i]:
            point = _parting(first, second)
            if point is not None:
                found.setdefault(point)
    return tuple(found)


def _parting(first: tuple[Point, ...], second: tuple[Point, ...]) -> Point | None:
    for k in range(1, min(len(first), len(second))):
        if first[k] == second[k]:
            continue
        last, a, b = first[k - 1], first[k], second[k]
        same_row = abs(a[1] - last[1]) < 0.01 and abs(b[1] - last[1]) < 0.01
        if same_row and (a[0] - last[0]) * (b[0] - last[0]) > 0:
            return a if abs(a[0] - last[0]) < abs(b[0] - last[0]) else b
        same_column = abs(a[0] - last[0]) < 0.01 and abs(b[0] - last[0]) < 0.01
        if same_column and (a[1] - last[1]) * (b[1] - last[1]) > 0:
            return a if abs(a[1] - last[1]) < abs(b[1] - last[1]) else b
        return last
    return None
