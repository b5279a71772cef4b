"""Where the error lies: for every signal its size over time, frequency, amplitude and rate, in units of the noise."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from delaytools.measurement.comparison import SignalComparison
from delaytools.report.style import axes_of, in_style, new_figure, title

__all__ = ["draw_strips"]

Array = np.ndarray
_NORM = LogNorm(0.5, 20.0)
_COLOURS = "YlOrRd"
_HEADS = ("Time (s)", "Frequency (Hz)", "Amplitude", "Rate")


@in_style
def draw_strips(signals: Sequence[SignalComparison], message: str) -> Figure:
    """A row for each signal; amplitude and rate in bins of equal time, from the smallest to the largest."""
    figure = new_figure(1.15 + 0.36 * len(signals))
    grid = axes_of(figure, len(signals), 4, share=("col", False))
    for row, one in zip(grid, signals, strict=True):
        for panel, (edges, sizes) in zip(row, _strips(one), strict=True):
            _strip(panel, edges, sizes)
        row[0].set_ylabel(one.signal, rotation=0, ha="right", va="center")
        row[1].set_xscale("log")
        row[1].xaxis.set_minor_formatter(NullFormatter())
        if row is not grid[-1]:
            for panel in row:
                panel.tick_params(axis="x", which="both", length=0)
    for panel, head in zip(grid[-1], _HEADS, strict=True):
        panel.set_xlabel(head)
    for panel in grid[-1][2:]:
        panel.set_xticks([0.1, 0.9], ["small", "large"])
        panel.tick_params(axis="x", length=0)
    bar = figure.colorbar(ScalarMappable(_NORM, _COLOURS), ax=[p for row in grid for p in row], pad=0.01, aspect=12)
    bar.set_label("Error ÷ noise", fontsize=7.5)
    bar.set_ticks([0.5, 1, 2, 5, 10, 20], labels=["≤ 0.5", "1", "2", "5", "10", "≥ 20"])
    bar.minorticks_off()
    title(figure, message)
    return figure


def _strip(panel: Axes, edges: Array, sizes: Array) -> None:
    if len(sizes):
        panel.pcolormesh(edges, [0, 1], sizes[None, :], norm=_NORM, cmap=_COLOURS, edgecolors="face", lw=0.3)
        panel.set_xlim(edges[0], edges[-1])
    panel.set_yticks([])
    panel.grid(visible=False)


def _strips(one: SignalComparison) -> list[tuple[Array, Array]]:
    """(edges, error ÷ noise) over time, frequency, amplitude, rate."""
    strips = one.strips
    ratio = (one.rms_error or 0.0) / max(one.explained_rms, 1e-300)
    time = ratio * np.sqrt(strips.time_shares * len(strips.time_shares))
    with np.errstate(divide="ignore", invalid="ignore"):
        band = np.sqrt(np.where(strips.noise_share > 0, 1.0 / strips.noise_share, 0.0) * strips.band_shares)
    found = [(strips.time_edges, time), (strips.band_edges[1:], np.nan_to_num(band[1:]))]
    for quantity in ("amplitude", "rate"):
        levels = [level for level in strips.levels if level.quantity == quantity]
        times = np.cumsum([0.0, *(level.share_of_time for level in levels)])
        even = np.array([level.share / max(level.share_of_time, 1e-12) for level in levels])
        found.append((times, ratio * np.sqrt(even)))
    return found
