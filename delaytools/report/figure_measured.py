"""Measured against modelled signals, with the residual and the band that noise explains."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from delaytools.measurement.comparison import SignalComparison
from delaytools.report.style import GREY, INK, VEHICLE, axes_of, in_style, new_figure, thinned, title

__all__ = ["draw_measured"]

_CLOSE = 0.05  # of the run: length of the close-up
_BAND = 2.0  # times the rms of what noise explains


@in_style
def draw_measured(one: SignalComparison, message: str) -> Figure:
    """Above both signals, below the residual; left the first log whole, right the stretch with the largest error."""
    figure = new_figure(3.1)
    grid = axes_of(figure, 2, 2, share=("col", "row"), heights=[1.5, 1])
    time, measured, model = one.traces[0]
    close = _close_up(time, measured - model)
    for column, (low, high) in enumerate(((time[0], time[-1]), close)):
        inside = (time >= low) & (time <= high)
        _signals(grid[0][column], time[inside], measured[inside], model[inside])
        _residual(grid[1][column], time[inside], (measured - model)[inside], one.explained_rms)
        grid[1][column].set_xlim(low, high)
        grid[1][column].set_xlabel("Time (s)")
    grid[0][0].axvspan(*close, color="#f3d9a4", alpha=0.6, lw=0, zorder=0)
    unit = f" ({one.unit})" if one.unit else ""
    grid[0][0].set_title("The whole run", loc="left")
    grid[0][1].set_title("Where the error is largest", loc="left")
    grid[0][0].set_ylabel(one.signal + unit)
    grid[1][0].set_ylabel("Measured −\nmodel" + unit)
    handles, labels = grid[0][0].get_legend_handles_labels()
    more, words = grid[1][0].get_legend_handles_labels()
    figure.legend(handles + more, labels + words, loc="outside lower center", ncols=4, fontsize=7.5)
    figure.align_ylabels([grid[0][0], grid[1][0]])
    title(figure, message)
    return figure


def _close_up(time: np.ndarray, residual: np.ndarray) -> tuple[float, float]:
    """The stretch of a twentieth of the run with the largest squared error."""
    rows = max(8, int(_CLOSE * len(time)))
    total = np.cumsum(np.r_[0.0, np.nan_to_num(residual) ** 2])
    first = int(np.argmax(total[rows:] - total[:-rows])) if len(time) > rows else 0
    return float(time[first]), float(time[min(first + rows, len(time) - 1)])


def _signals(panel: Axes, time: np.ndarray, measured: np.ndarray, model: np.ndarray) -> None:
    panel.plot(*thinned(time, measured), color="#9aa1ab", lw=1.8, label="measured", zorder=1)
    panel.plot(*thinned(time, model), color=VEHICLE, lw=0.8, label="model", zorder=2)


def _residual(panel: Axes, time: np.ndarray, residual: np.ndarray, noise: float) -> None:
    band = _BAND * noise
    panel.axhspan(-band, band, color="#c9e4d6", lw=0, zorder=0, label="±2 rms of what noise explains")
    panel.plot(*thinned(time, residual), color="#B00020", lw=0.6, label="residual", zorder=1)
    for level in (-band, 0.0, band):
        panel.axhline(level, color=INK if level == 0 else "#00704f", lw=0.5, zorder=2)
    panel.yaxis.label.set_color(GREY)
