"""Geometry of a block diagram: boxes in a grid, wires in the channels between them. Lengths in points, y down."""

from dataclasses import dataclass
from typing import final

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath

from delaytools.report.diagram_grid import Cell, Grid, grid_of
from delaytools.report.diagram_parts import Entry, Part
from delaytools.report.diagram_wires import Pin, Routed, Tracks, route

__all__ = ["Box", "Diagram", "Label", "Stub", "entry_margin", "layout"]

NAME, SMALL, WIRE = 7.6, 6.4, 6.4  # font sizes, points
LINE = 8.6
PAD = 5.0
PITCH = 7.0
_MEASURE = TextToPath()


@final
@dataclass(frozen=True)
class Label:
    """Words with their lower left corner (x, y) and size."""

    text: str
    x: float
    y: float
    width: float
    height: float


@final
@dataclass(frozen=True)
class Box:
    """A block's rectangle: left, top, width, height; `marks` stand under it within `foot` points."""

    part: Part
    cell: Cell
    x: float
    y: float
    width: float
    height: float
    foot: float


@final
@dataclass(frozen=True)
class Stub:
    """An outside signal that enters (arrow into the box) or leaves: from, to, its label."""

    start: tuple[float, float]
    end: tuple[float, float]
    label: Label
    sign: int


@final
@dataclass(frozen=True)
class Diagram:
    """All that is drawn, and the size of the sheet."""

    boxes: tuple[Box, ...]
    wires: tuple[Routed, ...]
    labels: tuple[Label, ...]
    stubs: tuple[Stub, ...]
    pins: tuple[Pin, ...]
    width: float
    height: float


def text_width(text: str, size: float, weight: str = "normal") -> float:
    """The width of a line of DejaVu Sans, points."""
    font = FontProperties(family="DejaVu Sans", size=size, weight=weight)
    return float(_MEASURE.get_text_width_height_descent(text, font, ismath=False)[0])


def layout(parts: tuple[Part, ...], at: str) -> Diagram:
    """The diagram of the parts, the loop through `at` first."""
    grid = grid_of(parts, at)
    sizes = {part.name: _size(part) for part in parts}
    written = {signal for part in parts for signal in part.outputs}
    read = {entry.signal for part in parts for entry in part.entries}
    tracks = Tracks.of(parts, grid)
    gaps = _gaps(parts, grid, tracks, written)
    lefts, tops = _places(parts, grid, sizes, gaps, tracks, written)
    boxes = tuple(_box(part, grid.cells[part.name], sizes[part.name], lefts, tops) for part in parts)
    pins = tuple(pin for box in boxes for pin in _pins(box, parts, grid, written))
    wires, labels = _wires(boxes, pins, tracks, (lefts, tops, gaps))
    stubs = _stubs(boxes, pins, written, read)
    width = lefts[-1][0] + gaps[-1].width
    height = tops[-1][0] + tops[-1][1] + _lane(tracks, grid.rows)
    return Diagram(boxes, wires, labels, stubs, pins, width, height)


def entry_margin(part: Part) -> float:
    """The room that port names or signs take inside a box, at the side where signals enter."""
    if len(part.entries) < 2:
        return 0.0
    return max(text_width(e.port or "+", 6.4) for e in part.entries) + 4.0


def _size(part: Part) -> tuple[float, float, float]:
    """(width, height, foot) of a box with its words."""
    ports = entry_margin(part)
    lines = [text_width(part.name, NAME, "bold"), *(text_width(t, SMALL) for t in (part.kind, *part.lines))]
    width = max(lines) + 2 * PAD + ports
    marks = [text_width(mark.words, 6.0) + 8 for mark in part.marks]
    width = max([width, *marks, 46.0])
    height = 2 * PAD + NAME + LINE * (1 + len(part.lines))
    height = max(height, 28.0 * len(part.entries) - 10.0)
    return width, height, 11.0 * len(part.marks)


@final
@dataclass(frozen=True)
class _Gap:
    """A vertical channel: its width, and how far from its left side tracks begin (0: they stand in the middle)."""

    width: float
    begin: float


def _gaps(parts: tuple[Part, ...], grid: Grid, tracks: Tracks, written: set[str]) -> list[_Gap]:
    """Each vertical channel: wide enough for the names of the wires that begin there, and for its tracks.

    Names stand above the wires of rows that run to the right and below those that run to the left, and wires turn
    away from their names, so that tracks and names can share the width.
    """
    gaps = []
    for channel in range(grid.columns + 1):
        left, right = [0.0], [0.0]
        for part in parts:
            cell = grid.cells[part.name]
            if _leaves_into(cell, channel):
                (left if cell.forward else right).extend(_label_width(s) for s in part.outputs)
            if channel == 0 and _at_left(cell):
                left += [_label_width(e.signal) for e in _outside(part, written)]
        count = len(tracks.vertical.get(channel, ()))
        names, room = max(*left, *right), PITCH * (count - 1) + 20.0
        several = any(len(p.outputs) > 1 and _leaves_into(grid.cells[p.name], channel) for p in parts)
        begin = names + 8.0 if several else 0.0
        gaps.append(_Gap(begin + room if several else max(names + 11.0, room), begin))
    return gaps


def _leaves_into(cell: Cell, channel: int) -> bool:
    return cell.column + int(cell.forward) == channel


def _label_width(signal: str) -> float:
    return max(text_width(line, WIRE) for line in label_lines(signal))


def label_lines(signal: str) -> list[str]:
    """A signal's name in one line, or two where it is long."""
    if len(signal) <= 9 or "_" not in signal:
        return [signal]
    middle = min((i for i, c in enumerate(signal) if c == "_"), key=lambda i: abs(i - len(signal) / 2))
    return [signal[: middle + 1], signal[middle + 1 :]]


def _lane(tracks: Tracks, index: int) -> float:
    """The height of a horizontal channel."""
    return 10.0 + 15.0 * len(tracks.horizontal.get(index, ()))


def _places(
    parts: tuple[Part, ...],
    grid: Grid,
    sizes: dict[str, tuple[float, float, float]],
    gaps: list[_Gap],
    tracks: Tracks,
    written: set[str],
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """(left, width) of every column and (top, height) of every row; the last entries are the far ends."""
    x, lefts = gaps[0].width, []
    for column in range(grid.columns):
        width = max((sizes[p.name][0] for p in parts if grid.cells[p.name].column == column), default=46.0)
        lefts.append((x, width))
        x += width + gaps[column + 1].width
    lefts.append((x - gaps[-1].width, 0.0))
    y, tops = 0.0, []
    for row in range(grid.rows):
        here = [p for p in parts if grid.cells[p.name].row == row]
        above = 24.0 if any(_from_above(p, grid, written) for p in here) else 0.0
        below = 24.0 if any(_from_below(p, grid, written) for p in here) else 0.0
        foot = max((sizes[p.name][2] for p in here), default=0.0)
        y += _lane(tracks, row) + above
        height = max((sizes[p.name][1] for p in here), default=30.0)
        tops.append((y, height))
        y += height + max(foot, below)
    tops.append((y, 0.0))
    return lefts, tops


def _outside(part: Part, written: set[str]) -> list[Entry]:
    return [e for e in part.entries if e.signal not in written]


def _at_left(cell: Cell) -> bool:
    """Outside signals enter the first box of the top row from the left."""
    return cell.row == 0 and cell.column == 0 and cell.forward


def _from_above(part: Part, grid: Grid, written: set[str]) -> bool:
    cell = grid.cells[part.name]
    return bool(_outside(part, written)) and not _at_left(cell) and cell.forward


def _from_below(part: Part, grid: Grid, written: set[str]) -> bool:
    return bool(_outside(part, written)) and not grid.cells[part.name].forward


def _box(
    part: Part,
    cell: Cell,
    size: tuple[float, float, float],
    lefts: list[tuple[float, float]],
    tops: list[tuple[float, float]],
) -> Box:
    """Centred in its column; all boxes of a row share their middle line."""
    left, column = lefts[cell.column]
    top, row = tops[cell.row]
    width, height, foot = size
    return Box(part, cell, left + (column - width) / 2, top + (row - height) / 2, width, height, foot)


def _pins(box: Box, parts: tuple[Part, ...], grid: Grid, written: set[str]) -> list[Pin]:
    """Where wires leave and enter the box; the straight neighbour's wire in the middle."""
    cell, middle = box.cell, box.y + box.height / 2
    right = box.x + box.width
    out_x, in_x = (right, box.x) if cell.forward else (box.x, right)
    out_channel, in_channel = cell.column + int(cell.forward), cell.column + int(not cell.forward)
    found = []
    count = len(box.part.outputs)
    for i, signal in enumerate(box.part.outputs):
        y = middle + (i - (count - 1) / 2) * 14.0
        found.append(
            Pin(
                box.part.name,
                signal,
                "out",
                out_x,
                y,
                out_channel,
                cell.row,
                1,
                "",
                1 if cell.forward else -1,
            )
        )
    inside = [e for e in box.part.entries if e.signal in written or _at_left(cell)]
    straight = _straight_entry(box, parts, grid, inside)
    others = [e for e in inside if e is not straight]
    placed = others if straight is None else ([straight, *others] if cell.forward else [*others, straight])
    centre = placed.index(straight) if straight is not None else (len(placed) - 1) / 2
    for i, entry in enumerate(placed):
        y = middle + (i - centre) * 14.0
        found.append(
            Pin(box.part.name, entry.signal, "in", in_x, y, in_channel, cell.row, entry.sign, entry.port)
        )
    return found


def _straight_entry(box: Box, parts: tuple[Part, ...], grid: Grid, entries: list[Entry]) -> Entry | None:
    """The entry whose writer stands next to the box in its row, facing it."""
    cell = box.cell
    outside = [e for e in entries if not any(e.signal in part.outputs for part in parts)]
    if outside:
        return outside[0]  # from the left edge of the sheet
    before = (cell.row, cell.column - 1 if cell.forward else cell.column + 1)
    for entry in entries:
        for part in parts:
            other = grid.cells[part.name]
            facing = (other.row, other.column) == before and other.forward == cell.forward
            if facing and part.outputs == (entry.signal,):
                return entry
    return None


def _wires(
    boxes: tuple[Box, ...],
    pins: tuple[Pin, ...],
    tracks: Tracks,
    sheet: tuple[list[tuple[float, float]], list[tuple[float, float]], list[_Gap]],
) -> tuple[tuple[Routed, ...], tuple[Label, ...]]:
    lefts, tops, gaps = sheet
    wires, labels = [], []
    for source in (pin for pin in pins if pin.kind == "out"):
        readers = [pin for pin in pins if pin.kind == "in" and pin.signal == source.signal]
        if not readers:
            continue
        routed = route(source, readers, tracks, (_channels(lefts, gaps, tracks), _lanes(tops, boxes, tracks)))
        wires.append(routed)
        labels.append(_wire_label(source))
    return tuple(wires), tuple(labels)


def _wire_label(source: Pin) -> Label:
    """At the wire's source: above it where it leaves to the right, below where to the left."""
    lines = label_lines(source.signal)
    width = _label_width(source.signal)
    x = source.x + 3 if source.x_side > 0 else source.x - 3 - width
    height = 7.4 * len(lines)
    y = source.y - 3 if source.x_side > 0 else source.y + 3.5 + height
    return Label("\n".join(lines), x, y, width, height)


def _channels(
    lefts: list[tuple[float, float]], gaps: list[_Gap], tracks: Tracks
) -> dict[tuple[int, str], float]:
    """(channel, signal) -> x of its vertical track, between the names at the channel's two sides."""
    found = {}
    for channel, signals in tracks.vertical.items():
        gap, last = gaps[channel], channel == len(gaps) - 1
        edge = lefts[-1][0] if last else lefts[channel][0] - gap.width
        middle = edge + (gap.width - PITCH * (len(signals) - 1)) / 2
        start = edge + gap.begin if gap.begin else middle
        for i, signal in enumerate(reversed(signals) if gap.begin else signals):
            found[channel, signal] = start + PITCH * i
    return found


def _lanes(
    tops: list[tuple[float, float]], boxes: tuple[Box, ...], tracks: Tracks
) -> dict[tuple[int, str], float]:
    """(horizontal channel, signal) -> y of its track, above the row of that number."""
    found = {}
    for lane, signals in tracks.horizontal.items():
        if lane < len(tops) - 1:
            ends = [b.y + b.height + max(b.foot, 0) for b in boxes if b.cell.row == lane - 1]
            top = max(ends, default=0.0)
        else:
            top = tops[-1][0]
        for i, signal in enumerate(signals):
            found[lane, signal] = top + 10.0 + 15.0 * i
    return found


def _stubs(
    boxes: tuple[Box, ...], pins: tuple[Pin, ...], written: set[str], read: set[str]
) -> tuple[Stub, ...]:
    found = []
    for box in boxes:
        if _at_left(box.cell):
            found += [_left_stub(pin) for pin in pins if pin.kind == "in" and pin.block == box.part.name
                      and pin.signal not in written]  # fmt: skip
        else:
            found += _vertical_stubs(box, written)
        found += [_leaving(pin) for pin in pins if pin.kind == "out" and pin.block == box.part.name
                  and pin.signal not in read]  # fmt: skip
    return tuple(found)


def _left_stub(pin: Pin) -> Stub:
    lines = label_lines(pin.signal)
    width = _label_width(pin.signal)
    label = Label("\n".join(lines), 2.0, pin.y - 3, width, 7.4 * len(lines))
    return Stub((2.0, pin.y), (pin.x, pin.y), label, pin.sign)


def _vertical_stubs(box: Box, written: set[str]) -> list[Stub]:
    found = []
    outside = _outside(box.part, written)
    for i, entry in enumerate(outside):
        x = box.x + box.width * (i + 1) / (len(outside) + 1)
        width = text_width(entry.signal, WIRE)
        if box.cell.forward:
            label = Label(entry.signal, x - width / 2, box.y - 16, width, 7.4)
            found.append(Stub((x, box.y - 14), (x, box.y), label, entry.sign))
        else:
            bottom = box.y + box.height
            label = Label(entry.signal, x - width / 2, bottom + 23.5, width, 7.4)
            found.append(Stub((x, bottom + 14), (x, bottom), label, entry.sign))
    return found


def _leaving(pin: Pin) -> Stub:
    side = pin.x_side
    label = _wire_label(pin)
    return Stub((pin.x, pin.y), (pin.x + side * (label.width + 8), pin.y), label, 1)
