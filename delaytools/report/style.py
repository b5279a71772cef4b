"""How figures look: sizes, a palette that colour-blind readers can tell apart, axes, and SVG as text."""

import io
import re
import textwrap
from collections.abc import Sequence
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from numpy.typing import NDArray

__all__ = [
    "BENCH",
    "FLIGHT",
    "GREY",
    "INK",
    "LINES",
    "PALETTE",
    "VEHICLE",
    "axes_of",
    "colours",
    "in_style",
    "new_figure",
    "styles",
    "svg_text",
    "thinned",
    "title",
]

Share = bool | Literal["none", "all", "row", "col"]
WIDTH = 6.9  # inch, the text width of an A4 page
INK, GREY, FLIGHT = "#1a1a1a", "#6b7280", "#000000"
VEHICLE, BENCH = "#0072B2", "#D55E00"
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#882255", "#8C6D1F", "#44AA99")
LINES = ("-", "--", "-.", (0, (1, 1.2)), (0, (5, 1, 1, 1, 1, 1)))
_LOOK: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "axes.edgecolor": "#8a8f98",
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6ea",
    "grid.linewidth": 0.6,
    "text.color": INK,
    "axes.labelcolor": INK,
    "xtick.color": "#4b5563",
    "ytick.color": "#4b5563",
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "delaytools",
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
}


# decorates a drawing function: the report's look is in force while it runs, and put back afterwards
in_style = matplotlib.rc_context(_LOOK)


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure of the report's width (inch), with its canvas; no state is shared with pyplot."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasSVG(figure)
    return figure


def axes_of(
    figure: Figure,
    rows: int = 1,
    columns: int = 1,
    *,
    share: tuple[Share, Share] = (False, False),
    heights: Sequence[float] | None = None,
) -> list[list[Axes]]:
    """A grid of axes in the report's look; share: x and y, heights: of the rows."""
    ratios = {"height_ratios": heights} if heights else None
    grid = figure.subplots(rows, columns, squeeze=False, sharex=share[0], sharey=share[1], gridspec_kw=ratios)
    for axes in grid.ravel():
        axes.spines[["top", "right"]].set_visible(False)
    return [list(row) for row in grid]


def title(figure: Figure, text: str) -> None:
    """The message of the figure, at its head."""
    lines = textwrap.fill(text, 84)
    figure.suptitle(lines, fontsize=9.5, fontweight="bold", x=0.01, ha="left", linespacing=1.25)


def thinned(t: NDArray[np.float64], y: NDArray[np.float64], points: int = 900) -> tuple[Any, Any]:
    """The smallest and largest value of each bin, in their order, so that no peak is lost; a bin of NaN is a gap."""
    if len(t) <= points:
        return t, y
    size = int(np.ceil(len(t) / (points // 2)))
    keep = []
    for start in range(0, len(t), size):
        part = y[start : start + size]
        if np.isnan(part).all():
            keep.append(start)
        else:
            keep += sorted({start + int(np.nanargmin(part)), start + int(np.nanargmax(part))})
    return t[keep], y[keep]


def colours(names: Sequence[str]) -> dict[str, str]:
    """A colour for each name, the same in every figure."""
    return {name: PALETTE[i % len(PALETTE)] for i, name in enumerate(dict.fromkeys(names))}


def styles(names: Sequence[str]) -> dict[str, Any]:
    """A line style for each name, so that curves differ in print too."""
    return {name: LINES[i % len(LINES)] for i, name in enumerate(dict.fromkeys(names))}


def svg_text(figure: Figure, name: str) -> str:
    """The figure as one <svg> element; identifiers begin with `name`, so that several can stand in a page."""
    target = io.StringIO()
    with matplotlib.rc_context(_LOOK):
        empty = {"Date": None, "Creator": None, "Format": None, "Type": None}
        figure.savefig(target, format="svg", metadata=empty)  # type: ignore[arg-type]
    text = target.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r'\bid="', f'id="{name}-', text)
    return re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)
