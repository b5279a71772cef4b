"""Runs as small multiples: a row for each configuration, a column for each signal."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from delaytools.report.runs import Run, Runs
from delaytools.report.style import GREY, INK, axes_of, in_style, new_figure, thinned, title

__all__ = ["draw_runs"]


@in_style
def draw_runs(runs: Runs, look: Mapping[str, str], message: str) -> Figure:
    """The first seconds of every run; columns share their axes, and a run that leaves them says so."""
    rows, columns = len(runs.runs), len(runs.signals)
    figure = new_figure(1.0 + 0.9 * rows)
    grid = axes_of(figure, rows, columns, share=(True, "col"))
    for column, signal in enumerate(runs.signals):
        limit = _limit(runs, signal)
        for row, run in enumerate(runs.runs):
            panel = grid[row][column]
            _trace(panel, run, signal, look[run.name], limit)
            panel.set_ylim(-limit, limit)
            _says(panel, run, signal, limit, runs.units.get(signal, ""))
        unit = runs.units.get(signal, "")
        grid[0][column].set_title(f"{signal} ({unit})" if unit else signal, loc="left")
        grid[-1][column].set_xlabel("Time (s)")
    for row, run in enumerate(runs.runs):
        _demand(grid[row], runs, run)
        grid[row][0].set_ylabel(
            run.name.replace("_", "\n"), fontsize=7.5, rotation=0, ha="right", va="center"
        )
    title(figure, message)
    return figure


def _limit(runs: Runs, signal: str) -> float:
    """1.15 times the largest excursion of the runs that stay within three times the median one."""
    peaks = [
        float(np.max(np.abs(r.record[signal]))) for r in runs.runs if signal in r.record and len(r.record)
    ]
    typical = 3 * float(np.median(peaks)) if peaks else 1.0
    kept = [p for p in peaks if p <= typical] or [typical]
    return 1.15 * max(kept) or 1.0


def _trace(panel: Axes, run: Run, signal: str, colour: str, limit: float) -> None:
    t, y = thinned(run.record.time, run.record[signal])
    far = np.flatnonzero(np.abs(y) > 3 * limit)
    if run.grows and far.size:
        t, y = t[: far[0] + 1], y[: far[0] + 1]
    panel.plot(t, y, color=colour, lw=0.9, zorder=2)
    panel.axhline(0, color="#c3c8cf", lw=0.6, zorder=1)


def _demand(row: list[Axes], runs: Runs, run: Run) -> None:
    demand, answer = runs.demand
    if answer in runs.signals and demand in run.record:
        panel = row[runs.signals.index(answer)]
        panel.plot(run.record.time, run.record[demand], color=INK, lw=0.8, ls=(0, (3, 2)), zorder=1)


def _says(panel: Axes, run: Run, signal: str, limit: float, unit: str) -> None:
    figures = run.figures.get(signal)
    if figures is None:
        return
    peak = float(np.max(np.abs(run.record[signal]))) if len(run.record) else np.inf
    if run.grows:
        text, colour = "grows without bound", "#B00020"
    elif peak > limit:
        text, colour = f"leaves the axis: {peak:.3g} {unit}", "#B00020"
    elif figures.oscillation_amplitude > 0:
        text = f"±{figures.oscillation_amplitude:.2g} {unit} at {figures.oscillation_frequency:.1f} Hz"
        colour = GREY
    else:
        return
    panel.text(
        0.985, 0.95, text, transform=panel.transAxes, ha="right", va="top", fontsize=6.8, color=colour, zorder=4,
        bbox={"boxstyle": "square,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.85},
    )  # fmt: skip
