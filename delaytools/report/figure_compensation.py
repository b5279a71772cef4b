"""Compensation: four margins, before, after, and in flight."""

import math

from matplotlib.figure import Figure

from delaytools.analysis.margins import Margins
from delaytools.report.compensation import Compensation
from delaytools.report.figure_margins import decibels
from delaytools.report.style import axes_of, in_style, new_figure, title

__all__ = ["draw_compensation"]

_LOOK = (("before", "#9aa1ab"), ("after", "#0072B2"), ("in flight", "#1a1a1a"))


@in_style
def draw_compensation(items: tuple[Compensation, ...], message: str) -> Figure:
    """Groups of three bars; a margin above flight's is a margin that the vehicle does not have."""
    figure = new_figure(2.6)
    panels = axes_of(figure, 1, 4)[0]
    labels = ("Gain margin (dB)", "Phase margin (deg)", "Delay margin (ms)", "Modulus margin")
    for index, (panel, label) in enumerate(zip(panels, labels, strict=True)):
        for place, item in enumerate(items):
            for bar, ((word, colour), margins) in enumerate(
                zip(_LOOK, (item.before, item.after, item.flight), strict=True)
            ):
                value = _numbers(margins)[index] if margins is not None else None
                x = place + (bar - 1) * 0.27
                panel.bar(x, value or 0.0, 0.25, color=colour, label=word if not index and not place else "")
                if margins is not None and not margins.stable:
                    panel.text(
                        x, 0, "unstable", rotation=90, ha="center", va="bottom", fontsize=6.5, color="#B00020"
                    )
        panel.set_title(label, loc="left")
        panel.grid(visible=False, axis="x")
        names = [item.name.replace("_", "\n") for item in items]
        panel.set_xticks(range(len(items)), names, fontsize=7 if len(items) < 3 else 6)
        if len(items) > 2:
            panel.tick_params(axis="x", labelrotation=45)
    figure.legend(loc="outside lower center", ncols=3)
    title(figure, message)
    return figure


def _numbers(margins: Margins) -> tuple[float | None, ...]:
    phase, delay = margins.phase_margin, margins.delay_margin
    return (
        decibels(margins.gain_margin),
        None if phase is None else math.degrees(abs(phase)),
        None if delay is None else delay * 1e3,
        margins.modulus_margin,
    )
