"""The error ladder: how the error on data not used for the fit falls, step by step."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from delaytools.diagnosis.answer import Step
from delaytools.report.style import BENCH, GREY, axes_of, in_style, new_figure, title
from delaytools.report.words import number

__all__ = ["draw_ladder", "helped"]


def helped(ladder: Sequence[Step]) -> tuple[str, ...]:
    """Signals whose error changes along the ladder."""
    first = ladder[0].errors
    falls = {s: max(abs(step.errors.get(s, first[s]) - first[s]) for step in ladder) for s in first}
    return tuple(s for s in first if falls[s] > 0.02 * first[s])


@in_style
def draw_ladder(ladder: Sequence[Step], units: Mapping[str, str], message: str) -> Figure:
    """A panel for each signal that something helps; a bar for each step, its held-out error written beside it."""
    signals = helped(ladder) or tuple(ladder[0].errors)[:3]
    figure = new_figure(0.75 + len(signals) * (0.42 + 0.24 * len(ladder)))
    grid = axes_of(figure, len(signals), 1)
    for (panel,), signal in zip(grid, signals, strict=True):
        _bars(panel, ladder, signal, units.get(signal, ""))
    title(figure, message)
    return figure


def _bars(panel: Axes, ladder: Sequence[Step], signal: str, unit: str) -> None:
    errors = [step.errors.get(signal, 0.0) for step in ladder]
    panel.barh(range(len(ladder)), errors, height=0.62, color=[BENCH, *["#0072B2"] * (len(ladder) - 1)])
    for row, step in enumerate(ladder):
        white = step.whitened.get(signal)
        beside = f"  {number(errors[row])} {unit}".rstrip()
        beside += f"  ({number(white)} × noise)" if white is not None else ""
        panel.text(errors[row], row, beside, va="center", fontsize=7, color=GREY)
    panel.set_yticks(range(len(ladder)), [step.step for step in ladder])
    panel.set_ylim(len(ladder) - 0.4, -0.6)
    panel.set_xlim(0, 1.45 * max(max(errors), 1e-300))
    panel.set_xlabel(f"Held-out rms error of {signal}" + (f" ({unit})" if unit else ""))
    panel.grid(visible=False, axis="y")
