"""The loop as a block diagram, drawn from its geometry."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from delaytools.report.diagram_layout import LINE, NAME, PAD, SMALL, WIRE, Box, Diagram, Stub, entry_margin
from delaytools.report.style import GREY, INK, in_style, new_figure

__all__ = ["draw_diagram"]

_FACE = {False: ("#eef4fb", "#0072B2"), True: ("#fdf0e4", "#D55E00")}
_WIRE = "#374151"
_MARK = "#882255"


@in_style
def draw_diagram(diagram: Diagram) -> Figure:
    """Boxes (vehicle blue, bench equipment orange), wires with their signals, effects as tags at their ports."""
    foot = 16.0
    scale, least = 1.0, 390.0
    width = max(diagram.width, least)
    figure = new_figure((diagram.height + foot) / 72, width=width / 72)
    figure.set_layout_engine("none")
    panel = figure.add_axes((0, 0, 1, 1))
    panel.set_xlim(0, width)
    panel.set_ylim(diagram.height + foot, 0)
    panel.axis("off")
    for wire in diagram.wires:
        for line in wire.lines:
            panel.plot([p[0] for p in line], [p[1] for p in line], color=_WIRE, lw=0.9 * scale, zorder=2)
        for joint in wire.joints:
            panel.plot(*joint, "o", color=_WIRE, ms=3.0 * scale, zorder=3)
        for pin in wire.readers:
            _arrow(
                panel,
                (pin.x - 0.01 * pin.x_side, pin.y),
                scale,
                _heading(wire.lines[0], pin.x, pin.y, wire.lines),
            )
    for label in diagram.labels:
        panel.text(label.x, label.y, label.text, fontsize=WIRE * scale, va="bottom", linespacing=1.0, color=_WIRE,
                   zorder=4, bbox={"boxstyle": "square,pad=0.05", "fc": "white", "ec": "none"})  # fmt: skip
    for stub in diagram.stubs:
        _stub(panel, stub, scale)
    for box in diagram.boxes:
        _box(panel, box, scale)
    _signs(panel, diagram, scale)
    _legend(panel, diagram, scale)
    return figure


def _heading(_: object, x: float, y: float, lines: tuple[tuple[tuple[float, float], ...], ...]) -> float:
    """+1 where the wire that ends at (x, y) runs to the right, else -1."""
    for line in lines:
        if line[-1] == (x, y):
            return 1.0 if line[-2][0] < x else -1.0
    return 1.0


def _arrow(panel: Axes, tip: tuple[float, float], scale: float, heading: float) -> None:
    size = 4.0
    x, y = tip
    xs = [x, x - heading * size, x - heading * size]
    panel.fill(xs, [y, y - 0.55 * size, y + 0.55 * size], color=_WIRE, lw=0, zorder=3)


def _stub(panel: Axes, stub: Stub, scale: float) -> None:
    (x0, y0), (x1, y1) = stub.start, stub.end
    panel.annotate("", (x1, y1), (x0, y0), zorder=2, arrowprops={
        "arrowstyle": "-|>", "color": _WIRE, "lw": 0.9 * scale, "shrinkA": 0, "shrinkB": 0,
        "mutation_scale": 6.5 * scale})  # fmt: skip
    if x0 == x1:
        panel.text(
            x1 + 3,
            (y0 + y1) / 2,
            "+" if stub.sign > 0 else "−",
            fontsize=7.5 * scale,
            va="center",
            color=_WIRE,
        )
    label = stub.label
    panel.text(label.x, label.y, label.text, fontsize=WIRE * scale, va="bottom", color=_WIRE, style="italic",
               linespacing=1.0, zorder=4)  # fmt: skip


def _box(panel: Axes, box: Box, scale: float) -> None:
    face, edge = _FACE[box.part.bench]
    panel.add_patch(FancyBboxPatch((box.x, box.y), box.width, box.height, boxstyle="round,pad=0,rounding_size=3",
                                   fc=face, ec=edge, lw=1.1 * scale, zorder=5))  # fmt: skip
    centre = box.x + (box.width + entry_margin(box.part) * (1 if box.cell.forward else -1)) / 2
    words = PAD + NAME + LINE * (1 + len(box.part.lines))
    y = box.y + (box.height - words) / 2 + PAD / 2
    panel.text(
        centre,
        y,
        box.part.name,
        fontsize=NAME * scale,
        weight="bold",
        ha="center",
        va="top",
        color=INK,
        zorder=6,
    )
    y += NAME + 3
    for i, line in enumerate((box.part.kind, *box.part.lines)):
        panel.text(centre, y + i * LINE, line, fontsize=SMALL * scale, ha="center", va="top", zorder=6,
                   color=GREY if i == 0 else INK, style="italic" if i == 0 else "normal")  # fmt: skip
    for i, mark in enumerate(box.part.marks):
        _mark(panel, box, i, mark.words, mark.side, scale)


def _mark(panel: Axes, box: Box, index: int, words: str, side: str, scale: float) -> None:
    """A tag under the box, on the side of the port where the effect acts, and a diamond on the port itself."""
    forward = box.cell.forward
    left = (side == "input") == forward if side != "inside" else None
    y = box.y + box.height + 2 + 11 * index
    x = {True: box.x, False: box.x + box.width, None: box.x + box.width / 2}[left]
    align = {True: "left", False: "right", None: "center"}[left]
    panel.text(x, y + 4.5, words, fontsize=6.0 * scale, ha=align, va="center", color=_MARK, zorder=6)
    if left is not None:
        x += -8 if left else 8
        panel.plot(
            x, box.y + box.height / 2, "D", color=_MARK, mec="white", mew=0.5, ms=5.0 * scale, zorder=7
        )


def _signs(panel: Axes, diagram: Diagram, scale: float) -> None:
    """Plus and minus inside the boxes where signals are summed, and port names where there are several."""
    counts = {box.part.name: len(box.part.entries) for box in diagram.boxes}
    forward = {box.part.name: box.cell.forward for box in diagram.boxes}
    for pin in diagram.pins:
        if pin.kind != "in" or counts[pin.block] < 2:
            continue
        text = pin.port or ("+" if pin.sign > 0 else "−")
        if pin.port and pin.sign < 0:
            text = f"−{pin.port}"
        side = 1 if forward[pin.block] else -1
        size = 5.8 if pin.port else 7.5
        panel.text(pin.x + 3 * side, pin.y, text, fontsize=size * scale, ha="left" if side > 0 else "right",
                   va="center", color=_WIRE, zorder=7)  # fmt: skip


def _legend(panel: Axes, diagram: Diagram, scale: float) -> None:
    y, x = diagram.height + 7, 4.0
    entries = [("flies with the vehicle", _FACE[False])]
    if any(box.part.bench for box in diagram.boxes):
        entries.append(("bench equipment, does not fly", _FACE[True]))
    for words, (face, edge) in entries:
        panel.add_patch(
            FancyBboxPatch((x, y - 4), 11, 8, boxstyle="round,pad=0,rounding_size=2", fc=face, ec=edge, lw=1)
        )
        panel.text(x + 16, y, words, fontsize=SMALL * scale, va="center", color=INK)
        x += 28 + 3.9 * len(words)
    if any(box.part.marks for box in diagram.boxes):
        panel.plot(x + 5, y, "D", color=_MARK, ms=5 * scale, mec="white", mew=0.5)
        panel.text(
            x + 14,
            y,
            "effect at a port, in some configuration",
            fontsize=SMALL * scale,
            va="center",
            color=INK,
        )
