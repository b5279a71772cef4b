"""Margins of every configuration beside flight, as dots; and against the delay, as curves."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from delaytools.report.delay_curves import DelayCurve
from delaytools.report.style import GREY, INK, axes_of, in_style, new_figure, styles, title
from delaytools.report.verdict import Verdict

__all__ = ["decibels", "draw_curves", "draw_margins"]

_DEG = 180 / math.pi
_PANELS = (
    ("Gain margin (dB)", lambda m: decibels(m.gain_margin)),
    ("Phase margin (deg)", lambda m: None if m.phase_margin is None else abs(m.phase_margin) * _DEG),
    ("Delay margin (ms)", lambda m: None if m.delay_margin is None else m.delay_margin * 1e3),
    ("Modulus margin", lambda m: m.modulus_margin),
)


def decibels(ratio: float | None) -> float | None:
    """|20 log10 ratio|: how far the gain may move, either way."""
    return None if not ratio else abs(20 * math.log10(ratio))


@in_style
def draw_margins(verdict: Verdict, message: str) -> Figure:
    """One row for each configuration, one panel for each margin: the bench as a dot, flight as a tick."""
    names = [row.name for row in verdict.rows]
    figure = new_figure(1.1 + 0.22 * len(names))
    panels = axes_of(figure, 1, 4, share=(False, True))[0]
    for panel, (label, get) in zip(panels, _PANELS, strict=True):
        _margin_panel(panel, verdict, get)
        panel.set_xlabel(label)
        panel.set_xlim(left=0)
        panel.margins(x=0.12)
        panel.set_xlim(left=0)
    panels[0].set_yticks(range(len(names)), names)
    panels[0].set_ylim(len(names) - 0.4, -0.6)
    handles, labels = panels[0].get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(unique.values(), unique.keys(), loc="outside lower center", ncols=4, fontsize=7.5)
    title(figure, message)
    return figure


def _margin_panel(panel: Axes, verdict: Verdict, get: object) -> None:
    for y, row in enumerate(verdict.rows):
        bench = get(row.bench)  # type: ignore[operator]
        flies = get(row.flight) if row.flight is not None else None  # type: ignore[operator]
        if bench is not None and flies is not None:
            panel.plot([bench, flies], [y, y], color="#c3c8cf", lw=2.2, zorder=1)
        if flies is not None:
            panel.plot(flies, y, "|", color=INK, ms=11, mew=2.0, label="in flight", zorder=2)
        if bench is not None:
            hot = row.judgement == "optimistic"
            look: dict[str, Any] = {"marker": "D" if hot else "o", "color": "#D55E00" if hot else "#0072B2"}
            word = "on the bench, optimistic" if hot else "on the bench"
            panel.plot(bench, y, ls="", ms=6, mec="white", mew=0.6, label=word, zorder=3, **look)
        else:
            word = "unstable" if not row.bench.stable else "no limit"
            panel.text(0.03, y, word, color="#B00020" if word == "unstable" else GREY, fontsize=7,
                       va="center", transform=panel.get_yaxis_transform())  # fmt: skip


@in_style
def draw_curves(curves: tuple[DelayCurve, ...], place: str, look: Mapping[str, str], message: str) -> Figure:
    """Gain, phase and delay margin against the delay at the place; beneath, where each family is stable."""
    figure = new_figure(5.9)
    heights = [3, 3, 3, 0.35 + 0.32 * len(curves)]
    panels = [row[0] for row in axes_of(figure, 4, 1, share=(True, False), heights=heights)]
    lines = styles([curve.family.name for curve in curves])
    for curve in curves:
        colour = look[curve.family.members[0][0]]
        x = curve.delays * 1e3
        with np.errstate(divide="ignore", invalid="ignore"):
            columns = (
                abs(20 * np.log10(curve.gain_margin)),
                np.abs(curve.phase_margin) * _DEG,
                curve.delay_margin * 1e3,
            )
        for panel, y in zip(panels, columns, strict=False):
            panel.plot(x, y, color=colour, ls=lines[curve.family.name], label=curve.family.name, zorder=2)
            _mark_present(panel, curve, y, look)
    for panel, label in zip(
        panels, ("Gain margin (dB)", "Phase margin (deg)", "Delay margin (ms)"), strict=False
    ):
        panel.set_ylabel(label)
        panel.set_ylim(bottom=0)
    _stable_bands(panels[3], curves, look)
    panels[3].set_xlabel(f"Delay at {place} (ms)")
    low, high = curves[0].delays[0] * 1e3, curves[0].delays[-1] * 1e3
    panels[0].set_xlim(low, high)
    handles, labels = panels[0].get_legend_handles_labels()
    words = "configurations (dots: as they stand)"
    figure.legend(
        handles, labels, loc="outside lower center", ncols=3, fontsize=7, title=words, title_fontsize=7
    )
    figure.align_ylabels(panels)
    title(figure, message)
    return figure


def _mark_present(panel: Axes, curve: DelayCurve, y: np.ndarray, look: Mapping[str, str]) -> None:
    for name, tau in curve.family.members:
        place = int(np.argmin(np.abs(curve.delays - tau)))
        if np.isfinite(y[place]):
            panel.plot(
                tau * 1e3,
                y[place],
                "o",
                color=look[name],
                mec="white",
                mew=0.7,
                ms=6,
                clip_on=False,
                zorder=3,
            )


def _stable_bands(panel: Axes, curves: tuple[DelayCurve, ...], look: Mapping[str, str]) -> None:
    """One row for each family: shaded where stable, with the ends written and the present delays as dots."""
    for row, curve in enumerate(curves):
        colour = look[curve.family.members[0][0]]
        for low, high in curve.stable:
            panel.barh(row, (high - low) * 1e3, left=low * 1e3, height=0.6, color=colour, alpha=0.3)
            if high < curve.delays[-1]:
                panel.annotate(f"{high * 1e3:.2f} ms", (high * 1e3, row), (4, 0), textcoords="offset points",
                               va="center", fontsize=7)  # fmt: skip
        if not curve.stable:
            panel.text(0.01, row, "stable nowhere here", color="#B00020", fontsize=7, va="center",
                       transform=panel.get_yaxis_transform())  # fmt: skip
        for name, tau in curve.family.members:
            panel.plot(
                tau * 1e3, row, "o", color=look[name], mec="white", mew=0.7, ms=6, clip_on=False, zorder=3
            )
    panel.set_ylim(len(curves) - 0.5, -0.5)
    panel.set_yticks([])
    panel.grid(visible=False)
    panel.set_ylabel("Stable", rotation=90)
