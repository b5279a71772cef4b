"""Nyquist curves with exact delay: the whole, and a zoom at the critical point."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from delaytools.report.nyquist import NyquistCurve
from delaytools.report.style import FLIGHT, GREY, axes_of, in_style, new_figure, title

__all__ = ["draw_nyquist"]

_MARKS = (0.1, 0.2, 0.5, 1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 100, 200)
_WIDE = 2.6


@in_style
def draw_nyquist(curves: tuple[NyquistCurve, ...], look: Mapping[str, str], message: str) -> Figure:
    """Left: |L| up to about 2.6. Right: around -1, with the circle of the smallest modulus margin."""
    figure = new_figure(4.05)
    wide, near = axes_of(figure, 1, 2)[0]
    for curve in curves:
        colour = FLIGHT if curve.flies else look[curve.name]
        line: dict[str, Any] = {
            "color": colour,
            "ls": "--" if curve.flies else "-",
            "lw": 1.2 if curve.flies else 1.5,
        }
        label = f"{curve.name}, in flight" if curve.flies else curve.name
        for panel in (wide, near):
            panel.plot(curve.value.real, curve.value.imag, label=label if panel is wide else "", **line)
    _circles(wide, near, curves)
    worst = min((c for c in curves if not c.flies), key=lambda c: (not c.stable, c.modulus))
    best = next((c for c in curves if c.flies), None)
    _frequencies(wide, worst, look, (-_WIDE, 1.4, -_WIDE, 1.4))
    spread = _near_size(curves)
    box = (-1 - spread, -1 + spread, -spread, spread)
    _frequencies(near, worst, look, box)
    if best is not None:
        _frequencies(near, best, look, box)
    for panel, limits in ((wide, (-_WIDE, 1.4, -_WIDE, 1.4)), (near, box)):
        panel.set_xlim(limits[0], limits[1])
        panel.set_ylim(limits[2], limits[3])
        panel.set_aspect("equal")
        panel.set_xlabel("Re L(jω)")
        panel.set_ylabel("Im L(jω)")
    near.set_title("near the critical point", loc="left")
    wide.set_title(f"dots: frequency in Hz on {worst.name}", loc="left")
    figure.legend(loc="outside lower center", ncols=4)
    title(figure, message)
    return figure


def _near_size(curves: tuple[NyquistCurve, ...]) -> float:
    return float(np.clip(1.3 * max(c.modulus for c in curves), 0.3, 1.3))


def _circles(wide: Axes, near: Axes, curves: tuple[NyquistCurve, ...]) -> None:
    for panel in (wide, near):
        panel.add_patch(Circle((0, 0), 1, fill=False, ec="#9aa1ab", ls=":", lw=1.0))
        panel.plot(-1, 0, "+", color="#B00020", ms=10, mew=1.8, zorder=5)
    stable = [c for c in curves if c.stable and not c.flies]
    if not stable:
        return
    least = min(stable, key=lambda c: c.modulus)
    near.add_patch(Circle((-1, 0), least.modulus, fill=False, ec="#B00020", lw=1.0))
    near.annotate(
        f"modulus margin {least.modulus:.3f}", (-1, -least.modulus), (0, -4), textcoords="offset points",
        ha="center", va="top", fontsize=7, color="#B00020", zorder=6,
        bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.85},
    )  # fmt: skip


def _frequencies(panel: Axes, curve: NyquistCurve, look: Mapping[str, str], box: tuple[float, ...]) -> None:
    """Dots with their frequency, those far enough from each other."""
    colour = FLIGHT if curve.flies else look[curve.name]
    hertz = curve.omega / (2 * math.pi)
    taken: list[complex] = []
    size = box[1] - box[0]
    for mark in _MARKS:
        if not hertz[0] <= mark <= hertz[-1]:
            continue
        at = complex(np.interp(mark, hertz, curve.value.real), np.interp(mark, hertz, curve.value.imag))
        inside = box[0] < at.real < box[1] - 0.08 * size and box[2] < at.imag < box[3] - 0.05 * size
        if not inside or any(abs(at - other) < 0.09 * size for other in taken):
            continue
        taken.append(at)
        panel.plot(at.real, at.imag, "o", ms=3.2, color=colour, zorder=4)
        panel.annotate(
            f"{mark:g}", (at.real, at.imag), (4, 3), textcoords="offset points", fontsize=7, color=GREY
        )
