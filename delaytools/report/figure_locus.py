"""Root locus in delay: the rightmost roots, coloured by the delay, over a grid of damping and frequency."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
    s = np.concatenate(locus.roots)
    tau = np.concatenate([np.full(len(r), t) for r, t in zip(locus.roots, locus.delays, strict=True)])
    dots = panel.scatter(s.real, s.imag, c=tau * 1e3, cmap="viridis", s=7, lw=0, zorder=3)
    bar = figure.colorbar(dots, ax=panel, pad=0.015, aspect=30)
    bar.set_label(f"Delay at {place} (ms)", fontsize=8)
    bar.ax.tick_params(labelsize=7.5)
    panel.axvline(0, color="#B00020", lw=1.0)
    panel.axvspan(0, right, color="#B00020", alpha=0.06, lw=0)
    _mark_present(panel, locus)
    for delay, omega in locus.crossings:
        panel.plot(0, omega, "D", color="#B00020", mec="white", ms=6.5, zorder=5, clip_on=False)
        panel.annotate(
            f"crosses at {delay * 1e3:.2f} ms,\n{omega / (2 * math.pi):.2f} Hz", (0, omega), (9, 6),
            textcoords="offset points", fontsize=7.5, color="#B00020", va="bottom", zorder=6, bbox=_PLATE,
        )  # fmt: skip
    panel.set_xlabel("Re s (rad/s)")
    panel.set_ylabel("Im s (rad/s)")
    title(figure, message)
    return figure


def _box(locus: Locus) -> tuple[float, float, float]:
    """The dominant oscillatory roots and the crossings, with room."""
    leading = np.concatenate([r[:2] for r in locus.roots if len(r)])
    top = max([abs(leading.imag).max(), *(w for _, w in locus.crossings)], default=1.0)
    top = 1.25 * max(top, 1.0)
    left = max(float(leading.real.min()), -1.5 * top)
    right = max(float(leading.real.max()), 0.12 * abs(left))
    return 1.15 * left, 1.9 * right if locus.crossings else 1.3 * right, top


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
