"""Amplitude and frequency of limit cycles against the delay."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from delaytools.report.cycles import CycleCurve, kind_of
from delaytools.report.style import GREY, INK, axes_of, in_style, new_figure, title

__all__ = ["draw_cycles"]

WIDE = 1e3  # the largest amplitude drawn, over the least


@in_style
def draw_cycles(
    curves: tuple[CycleCurve, ...], amplitude: str, place: str, look: Mapping[str, str], message: str
) -> Figure:
    """Full lines: cycles that last; dashed: those that part what dies out from what grows. Dots: configurations as they
    stand, crosses: where their runs ended. amplitude: what the upper axis says."""
    figure = new_figure(4.3)
    panels = [row[0] for row in axes_of(figure, 2, 1, share=(True, False), heights=[3, 2])]
    for curve in curves:
        colour = look[curve.family.members[0][0]]
        _lines(panels, curve, colour)
        _present(panels, curve, look)
        for panel in panels:
            for delay in curve.lost:
                panel.axvline(delay * 1e3, color=colour, lw=1.0, ls=":", zorder=1)
    panels[0].set_yscale("log")
    panels[0].yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panels[0].yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    panels[0].yaxis.set_minor_formatter(NullFormatter())
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(low, min(high, WIDE * low))
    panels[0].set_ylabel(amplitude)
    panels[1].set_ylabel("Frequency (Hz)")
    panels[1].set_ylim(bottom=0)
    panels[1].set_xlabel(f"Delay at {place} (ms)")
    _legend(figure, curves, look)
    figure.align_ylabels(panels)
    title(figure, message)
    return figure


def _lines(panels: list[Axes], curve: CycleCurve, colour: str) -> None:
    for line in curve.lines:
        for panel, y in zip(panels, (line.amplitudes, line.frequencies), strict=True):
            panel.plot(
                line.delays * 1e3, y, color=colour, ls="-" if line.lasts else "--", marker=".", ms=3.5, zorder=2,
            )  # fmt: skip


def _present(panels: list[Axes], curve: CycleCurve, look: Mapping[str, str]) -> None:
    for name, delay, found in curve.present:
        for one in (one for one in found.cycles if kind_of(one) != "neither"):
            for panel, y in zip(panels, (one.amplitude, one.frequency), strict=True):
                panel.plot(
                    delay * 1e3, y, "o", ms=7, mec=look[name], mew=1.4, zorder=4,
                    mfc=look[name] if one.stable else "white",
                )  # fmt: skip
            if one.check is not None and np.isfinite(one.check.amplitude):
                for panel, y in zip(panels, (one.check.amplitude, one.check.frequency), strict=True):
                    panel.plot(delay * 1e3, y, "x", color=INK, ms=6, mew=1.3, zorder=5)


def _legend(figure: Figure, curves: tuple[CycleCurve, ...], look: Mapping[str, str]) -> None:
    shown = [curve for curve in curves if curve.lines]
    handles = [
        Line2D([], [], color=look[curve.family.members[0][0]], label=curve.family.name) for curve in shown
    ]
    every = [one for curve in curves for one in curve.lines]
    words = (("-", "lasts", True), ("--", "parts what dies out from what grows", False))
    handles += [
        Line2D([], [], color=GREY, ls=style, label=label)
        for style, label, lasts in words if any(one.lasts == lasts for one in every)
    ]  # fmt: skip
    here = [
        one for curve in curves for _, _, found in curve.present for one in found.cycles if kind_of(one) != "neither"
    ]
    if here:
        handles.append(Line2D([], [], color=GREY, ls="", marker="o", mfc="white", label="a configuration as it stands"))
    if any(one.check is not None and np.isfinite(one.check.amplitude) for one in here):
        handles.append(Line2D([], [], color=INK, ls="", marker="x", label="where its runs ended"))
    if any(curve.lost for curve in curves):
        handles.append(Line2D([], [], color=GREY, ls=":", label="linear loop unstable from here on"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=7)
