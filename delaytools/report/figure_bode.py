"""Bode and Nichols plots of opened loops with their margins marked."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator
from numpy.typing import NDArray

from delaytools.analysis.margins import Margins
from delaytools.report.nyquist import NyquistCurve
from delaytools.report.style import GREY, axes_of, in_style, new_figure, title

__all__ = ["Marked", "draw_bode", "draw_nichols"]

CRITICAL = "#B00020"
_DEG, _HERTZ = 180 / math.pi, 1 / (2 * math.pi)
_PLATE = {"boxstyle": "square,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.85}
_CONTOURS = (12.0, 6.0, 3.0, 1.0, 0.0, -1.0, -3.0, -6.0, -12.0, -20.0)  # dB of |L/(1 + L)|
_DOTS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200)  # Hz
LOWEST, HIGHEST, TOP = -46.0, 30.0, 45.0  # dB that are drawn at most, and deg above -180 of a Nichols plot's middle


@final
@dataclass(frozen=True)
class Marked:
    """A curve and the margins of its loop."""

    curve: NyquistCurve
    margins: Margins

    @property
    def decibels(self) -> NDArray[np.float64]:
        """20 log10 |L|."""
        return np.asarray(20 * np.log10(np.abs(self.curve.value)))

    @property
    def degrees(self) -> NDArray[np.float64]:
        """arg L, continuous, within a turn below 0 where it begins."""
        phase = np.unwrap(np.angle(self.curve.value)) * _DEG
        return np.asarray(phase - 360 * np.ceil(phase[0] / 360 - 1e-9))


@in_style
def draw_bode(loops: Sequence[Marked], look: Mapping[str, str], message: str) -> Figure:
    """|L| in dB and arg L in degrees over the frequency in Hz; bars from the curves to 0 dB and -180° are margins."""
    figure = new_figure(5.0)
    (upper,), (lower,) = axes_of(figure, 2, 1, share=("col", False))
    for one in loops:
        hertz, colour = one.curve.omega * _HERTZ, look[one.curve.name]
        upper.semilogx(hertz, one.decibels, color=colour, label=one.curve.name)
        lower.semilogx(hertz, one.degrees, color=colour)
        _gain_bar(upper, one, colour)
        _phase_bar(lower, one, colour)
    upper.axhline(0, color=CRITICAL, lw=0.9)
    upper.set_ylim(LOWEST, HIGHEST)
    for turn in _odd_half_turns(loops):
        lower.axhline(turn, color=CRITICAL, lw=0.9)
    low = min(float(one.degrees[one.decibels > LOWEST].min()) for one in loops)
    top = max(float(one.degrees.max()) for one in loops)
    lower.set_ylim(max(low, -900) - 20, top + 20)
    lower.yaxis.set_major_locator(_quarter_turns(top - max(low, -900)))
    _told(upper, [(_gain_words(one), look[one.curve.name]) for one in loops])
    _told(lower, [(_phase_words(one), look[one.curve.name]) for one in loops])
    lower.xaxis.set_major_formatter(FuncFormatter(lambda hertz, _: f"{hertz:g}"))
    upper.set_ylabel("|L| (dB)")
    lower.set_ylabel("arg L (deg)")
    lower.set_xlabel("Frequency (Hz)")
    if len(loops) > 1:
        figure.legend(loc="outside lower center", ncols=4)
    title(figure, message)
    return figure


@in_style
def draw_nichols(loops: Sequence[Marked], look: Mapping[str, str], message: str) -> Figure:
    """|L| in dB over arg L in degrees, on contours of |L/(1 + L)| in dB; dots: frequencies in Hz on the first curve."""
    figure = new_figure(4.6)
    panel = axes_of(figure)[0][0]
    shift = {one.curve.name: 360 * round((-180 - _near_critical(one)) / 360) for one in loops}
    reach = [one.degrees[one.decibels > LOWEST] + shift[one.curve.name] for one in loops]
    left = max(min(float(rows.min()) for rows in reach), -180 - 360)
    right = min(max(float(rows.max()) for rows in reach), -180 + 270)
    left, right = min(left, -180 - TOP) - 10, max(right, -180 + TOP) + 10
    _contours(panel, (left, right))
    for one in loops:
        name = one.curve.name
        panel.plot(one.degrees + shift[name], one.decibels, color=look[name], label=name, zorder=4)
    _dots(panel, loops[0], shift[loops[0].curve.name], (left, right))
    for turn in (-540, -180):
        if left < turn < right:
            panel.plot(turn, 0, "+", color=CRITICAL, ms=11, mew=1.9, zorder=6)
    panel.set_xlim(left, right)
    panel.set_ylim(-32, HIGHEST)
    panel.xaxis.set_major_locator(_quarter_turns(right - left))
    panel.set_xlabel("arg L (deg)")
    panel.set_ylabel("|L| (dB)")
    if len(loops) > 1:
        figure.legend(loc="outside lower center", ncols=4)
    title(figure, message)
    return figure


def _quarter_turns(span: float) -> MultipleLocator:
    return MultipleLocator(45 if span < 400 else 90 if span < 800 else 180)


def _gain_bar(panel: Axes, one: Marked, colour: str) -> None:
    """From the curve to 0 dB at the frequency of the gain margin."""
    m = one.margins
    if m.gain_margin is not None and m.gain_margin_frequency and m.gain_margin_frequency < math.inf:
        hertz, level = m.gain_margin_frequency * _HERTZ, -20 * math.log10(m.gain_margin)
        panel.plot([hertz, hertz], [level, 0], color=colour, lw=2.4, solid_capstyle="butt", zorder=5)


def _gain_words(one: Marked) -> str:
    m = one.margins
    if m.gain_margin is None:
        return f"gain margin: {m.why.get('gain_margin', 'none')}"
    at = f" at {m.gain_margin_frequency * _HERTZ:.3g} Hz" if m.gain_margin_frequency is not None else ""
    return f"gain margin {m.gain_margin:.4g} ({20 * math.log10(m.gain_margin):+.1f} dB){at}"


def _phase_bar(panel: Axes, one: Marked, colour: str) -> None:
    """From the nearest odd half turn to the curve at the crossover."""
    m = one.margins
    if m.phase_margin is not None and m.phase_margin_frequency is not None:
        hertz = m.phase_margin_frequency * _HERTZ
        at = float(np.interp(math.log(hertz), np.log(one.curve.omega * _HERTZ), one.degrees))
        ends = [at - m.phase_margin * _DEG, at]
        panel.plot([hertz, hertz], ends, color=colour, lw=2.4, solid_capstyle="butt", zorder=5)


def _phase_words(one: Marked) -> str:
    m = one.margins
    if m.phase_margin is None or m.phase_margin_frequency is None:
        return f"phase margin: {m.why.get('phase_margin', 'none')}"
    late = "" if m.delay_margin is None else f", delay margin {m.delay_margin * 1e3:.4g} ms"
    return f"phase margin {m.phase_margin * _DEG:.3g} deg{late} at {m.phase_margin_frequency * _HERTZ:.3g} Hz"


def _told(panel: Axes, lines: Sequence[tuple[str, str]]) -> None:
    """Words of each curve in its colour, in the lower left corner, which a loop that falls leaves free."""
    for place, (words, colour) in enumerate(reversed(lines)):
        panel.annotate(
            words, (0.012, 0.04), (0, 10 * place), xycoords="axes fraction", textcoords="offset points", fontsize=7,
            color=colour, zorder=6, bbox=_PLATE,
        )  # fmt: skip


def _odd_half_turns(loops: Sequence[Marked]) -> list[float]:
    """-180° and the odd half turns at which a margin is taken."""
    found = {-180.0}
    for one in loops:
        m = one.margins
        if m.phase_margin is not None and m.phase_margin_frequency is not None:
            at = float(np.interp(m.phase_margin_frequency, one.curve.omega, one.degrees)) - m.phase_margin * _DEG
            found.add(float(180 + 360 * round((at - 180) / 360)))
    return sorted(found)


def _near_critical(one: Marked) -> float:
    """The phase, in degrees, where the curve is nearest to an odd half turn at 0 dB."""
    return float(one.degrees[int(np.argmin(np.abs(1 + one.curve.value)))])


def _contours(panel: Axes, limits: tuple[float, float]) -> None:
    """|L/(1 + L)| = const about each odd half turn: T = M e^{jθ}, L = T/(1 - T)."""
    panel.grid(visible=False)
    panel.axhline(0, color="#d7dbe0", lw=0.7)
    theta = np.linspace(-2 * np.pi + 1e-4, -1e-4, 721)
    for level in _CONTOURS:
        closed = 10 ** (level / 20) * np.exp(1j * theta)
        with np.errstate(divide="ignore"):
            opened = closed / (1 - closed)
        decibels = 20 * np.log10(np.abs(opened))
        phase = np.angle(-opened) * _DEG - 180  # about -180, from -360 to 0
        breaks = np.flatnonzero(np.abs(np.diff(phase)) > 90) + 1
        for turn in (-360, 0, 360):
            for rows in np.split(np.arange(len(theta)), breaks):
                panel.plot(phase[rows] + turn, decibels[rows], color="#d7dbe0", lw=0.7, zorder=1)
        near = np.abs(phase + (180 if level > 0 else 360))
        at = np.flatnonzero(near < 1.0)
        if len(at) and limits[0] < phase[at[0]] < limits[1]:
            top = at[np.argmax(decibels[at])]
            if -32 < decibels[top] < HIGHEST - 1:
                panel.annotate(
                    f"{level:g} dB", (phase[top], decibels[top]), fontsize=6.3, color=GREY, ha="center", va="center",
                    zorder=2, bbox={"boxstyle": "square,pad=0.05", "fc": "white", "ec": "none"},
                )  # fmt: skip


def _dots(panel: Axes, one: Marked, shift: float, limits: tuple[float, float]) -> None:
    """Frequencies along a curve."""
    hertz = one.curve.omega * _HERTZ
    for mark in _DOTS:
        if not hertz[0] <= mark <= hertz[-1]:
            continue
        x = float(np.interp(mark, hertz, one.degrees)) + shift
        y = float(np.interp(mark, hertz, one.decibels))
        if limits[0] < x < limits[1] - 8 and -31 < y < HIGHEST - 2:
            panel.plot(x, y, "o", ms=3.4, color="#1a1a1a", zorder=5)
            panel.annotate(f"{mark:g} Hz", (x, y), (5, 3), textcoords="offset points", fontsize=6.8, zorder=6)
