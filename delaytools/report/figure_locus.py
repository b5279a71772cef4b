"""Root locus in delay: the rightmost roots, coloured by the delay, over a grid of damping and frequency."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from delaytools.analysis.root_loci import Branch
from delaytools.report.locus import Locus
from delaytools.report.style import GREY, axes_of, in_style, new_figure, title

__all__ = ["draw_locus"]

_PLATE = {"boxstyle": "square,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85}
_DAMPING = (0.1, 0.2, 0.3, 0.5, 0.7, 0.9)


@in_style
def draw_locus(locus: Locus, place: str, message: str) -> Figure:
    """Upper half plane in Hz on the imaginary axis; dots at the crossings, rings at the present delays."""
    figure = new_figure(3.7)
    panel = axes_of(figure)[0][0]
    panel.grid(visible=False)
    left, right, top = _box(locus)
    panel.set_xlim(left, right)
    panel.set_ylim(0, top)
    _grid(panel, left, top)
    bar = figure.colorbar(_draw_branches(panel, locus), ax=panel, pad=0.015, aspect=30)
    bar.set_label(f"Delay at {place} (ms)", fontsize=8)
    bar.ax.tick_params(labelsize=7.5)
    panel.axvline(0, color="#B00020", lw=1.0)
    panel.axvspan(0, right, color="#B00020", alpha=0.06, lw=0)
    _mark_present(panel, locus)
    for one in (one for one in locus.crossings if one.frequency < top):
        panel.plot(0, one.frequency, "D", color="#B00020", mec="white", ms=6.5, zorder=5, clip_on=False)
        panel.annotate(
            f"crosses at {one.value * 1e3:.2f} ms,\n{one.frequency / (2 * math.pi):.2f} Hz", (0, one.frequency), (9, 6),
            textcoords="offset points", fontsize=7.5, color="#B00020", va="bottom", zorder=6, bbox=_PLATE,
        )  # fmt: skip
    panel.set_xlabel("Re s (rad/s)")
    panel.set_ylabel("Im s (rad/s)")
    title(figure, message)
    return figure


def _draw_branches(panel: Axes, locus: Locus) -> LineCollection:
    """Every branch as a line that takes its colour from the delay."""
    pieces, delays = [], []
    for branch in locus.branches:
        points = np.stack([branch.roots.real, branch.roots.imag], axis=1)
        pieces.append(np.stack([points[:-1], points[1:]], axis=1))
        delays.append(0.5 * (branch.values[:-1] + branch.values[1:]))
    lines = LineCollection(np.concatenate(pieces), cmap="viridis", lw=1.8, zorder=3)
    lines.set_array(1e3 * np.concatenate(delays))
    lines.set_clim(1e3 * locus.span[0], 1e3 * locus.span[1])
    panel.add_collection(lines, autolim=False)
    return lines


def _box(locus: Locus) -> tuple[float, float, float]:
    """The dominant oscillatory roots and the crossings, with room."""
    rows = [one.roots[np.argmax(one.roots.real)] for one in _dominant(locus)]
    rows += [s for one in _dominant(locus) for s in (one.roots[0], one.roots[-1])]
    leading = np.array(rows)
    top = max([abs(leading.imag).max(), *(one.frequency for one in locus.crossings[:1])], default=1.0)
    top = 1.25 * max(top, 1.0)
    left = max(float(leading.real.min()), -1.5 * top)
    right = max(float(leading.real.max()), 0.12 * abs(left))
    return 1.15 * left, 1.9 * right if locus.crossings else 1.3 * right, top


def _dominant(locus: Locus) -> list[Branch]:
    """The branches of which one is the rightmost or next to it somewhere."""
    delays = np.linspace(*locus.span, 21)
    levels = np.array([
        np.interp(delays, one.values, one.roots.real, left=-np.inf, right=-np.inf) for one in locus.branches
    ])
    best = np.argsort(-levels, axis=0)[:2]
    return [locus.branches[k] for k in np.unique(best)]


def _mark_present(panel: Axes, locus: Locus) -> None:
    by_root: dict[complex, list[str]] = {}
    for name, delay, root in locus.present:
        if root.imag > 1e-6 * abs(root):
            by_root.setdefault(complex(round(root.real, 6), round(root.imag, 6)), []).append(
                f"{name} ({delay * 1e3:g} ms)"
            )
    for root, names in by_root.items():
        panel.plot(root.real, root.imag, "o", mfc="none", mec="#1a1a1a", ms=9, mew=1.3, zorder=6)
        edge = root.real < 0.7 * panel.get_xlim()[0]
        panel.annotate(
            ",\n".join(names), (root.real, root.imag), (9, 3) if edge else (-8, -8), textcoords="offset points",
            fontsize=7.5, ha="left" if edge else "right", va="bottom" if edge else "top", zorder=6, bbox=_PLATE,
        )  # fmt: skip


def _grid(panel: Axes, left: float, top: float) -> None:
    """Rays of equal damping, circles of equal natural frequency in Hz."""
    for damping in _DAMPING:
        angle = math.acos(damping)
        reach = min(abs(left) / damping, top / math.sin(angle))
        x, y = -reach * damping, reach * math.sin(angle)
        panel.plot([0, x], [0, y], color="#d7dbe0", lw=0.7, zorder=1)
        panel.annotate(
            f"ζ {damping:g}", (x * 0.97, y * 0.97), fontsize=6.5, color=GREY, ha="center", va="center", zorder=2,
            bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"},
        )  # fmt: skip
    hertz = _nice(top / (2 * math.pi) / 5)
    angles = np.linspace(math.pi / 2, math.pi, 60)
    for k in range(1, 8):
        radius = 2 * math.pi * hertz * k
        if radius < top:
            panel.plot(
                radius * np.cos(angles), radius * np.sin(angles), color="#d7dbe0", lw=0.7, ls=":", zorder=1
            )
            panel.annotate(f"{hertz * k:g} Hz", (0, radius), (3, 0), textcoords="offset points", fontsize=6.5,
                           color=GREY, va="center", zorder=2)  # fmt: skip


def _nice(step: float) -> float:
    power = 10.0 ** math.floor(math.log10(step))
    return min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(m * power - step)) * power
