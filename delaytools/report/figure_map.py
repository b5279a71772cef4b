"""A stability map: the stable part of a plane, the curves on which roots cross the axis, and to which side."""

import math
from dataclasses import dataclass
from typing import final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from delaytools.analysis.map_curves import CrossingCurve
from delaytools.analysis.stability_map import StabilityMap
from delaytools.report.style import GREY, INK, axes_of, in_style, new_figure, title

__all__ = ["AxisWords", "draw_map"]

STABLE, SHADES = "#cfe5f3", ("#fbe9dd", "#f3cdb2", "#e7ab85")
WORDS = ("stable", "1 or 2 unstable roots", "3 or 4", "more")
TICK, SHAPE = 0.024, np.array([2.0, 1.0])  # of the panel's height: marks on the unstable side; width and height
APART, LONG = 0.08, 0.2  # between marks, and the least length of a curve that is given its frequency
_PLATE = {"boxstyle": "square,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.85}


@final
@dataclass(frozen=True)
class AxisWords:
    """How an axis is labelled, and what a value is multiplied with for it."""

    label: str
    factor: float = 1.0


@in_style
def draw_map(
    found: StabilityMap, x: AxisWords, y: AxisWords, message: str, here: tuple[float, float] | None = None
) -> Figure:
    """The plane by the count of unstable roots; crossing curves with their frequency in Hz, marks on the side where the
    root is unstable; here: the loop as it stands."""
    figure = new_figure(4.2)
    panel = axes_of(figure)[0][0]
    panel.grid(visible=False)
    colours, norm = ListedColormap([STABLE, *SHADES]), BoundaryNorm([-0.5, 0.5, 2.5, 4.5, 1e9], 4)
    counts = np.where(np.isfinite(found.counts), found.counts, 1e6)
    panel.pcolormesh(
        found.grid_x * x.factor, found.grid_y * y.factor, counts, cmap=colours, norm=norm, shading="nearest",
        rasterized=True,
    )  # fmt: skip
    panel.set_xlim(found.spans[0][0] * x.factor, found.spans[0][1] * x.factor)
    panel.set_ylim(found.spans[1][0] * y.factor, found.spans[1][1] * y.factor)
    for curve in found.curves:
        _draw_curve(panel, curve, (x.factor, y.factor), found)
    if here is not None:
        panel.plot(
            here[0] * x.factor, here[1] * y.factor, "o", color="#0072B2", mec="white", ms=7, zorder=6, clip_on=False,
        )  # fmt: skip
        panel.annotate(
            "as it stands", (here[0] * x.factor, here[1] * y.factor), (8, 5), textcoords="offset points", fontsize=7,
            zorder=6, bbox=_PLATE,
        )  # fmt: skip
    panel.set_xlabel(x.label)
    panel.set_ylabel(y.label)
    shown = [k for k in range(4) if np.any((counts > norm.boundaries[k]) & (counts < norm.boundaries[k + 1]))]
    handles = [Patch(fc=[STABLE, *SHADES][k], ec="#8a8f98", lw=0.5, label=WORDS[k]) for k in shown]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    title(figure, message)
    return figure


def _draw_curve(panel: Axes, curve: CrossingCurve, factors: tuple[float, float], found: StabilityMap) -> None:
    """The line, marks at right angles on the unstable side, and the frequency once."""
    wide = np.array([span[1] - span[0] for span in found.spans]) / SHAPE
    place = np.stack([curve.x, curve.y], axis=1)
    panel.plot(place[:, 0] * factors[0], place[:, 1] * factors[1], color=INK, lw=1.3, zorder=4)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place / wide, axis=0), axis=1))])
    count = int(along[-1] / APART)
    if count < 2:
        return
    at = np.linspace(0.5 * APART, along[-1] - 0.5 * APART, count)
    here, ahead, side = (
        np.stack([np.interp(where, along, rows[:, k]) for k in (0, 1)], axis=1)
        for where, rows in ((at, place / wide), (at + 0.01, place / wide), (at, curve.towards * wide))
    )
    normal = np.stack([here[:, 1] - ahead[:, 1], ahead[:, 0] - here[:, 0]], axis=1)
    normal *= np.sign(np.sum(normal * side, axis=1))[:, None]
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    for start, way in zip(here, normal, strict=True):
        ends = np.stack([start, start + TICK * way]) * wide * factors
        panel.plot(ends[:, 0], ends[:, 1], color=INK, lw=0.7, zorder=4)
    k = int(np.argmin(np.abs(along - 0.5 * along[-1])))
    inside = all(low <= place[k, j] <= high for j, (low, high) in enumerate(found.spans))
    if inside and along[-1] > LONG and 0 < curve.frequency[k] < math.inf:
        words = f"{curve.frequency[k] / (2 * math.pi):.3g} Hz"
        panel.annotate(
            words, place[k] * factors, (5, 7), textcoords="offset points", fontsize=6.8, color=GREY, zorder=5,
            bbox=_PLATE,
        )  # fmt: skip
