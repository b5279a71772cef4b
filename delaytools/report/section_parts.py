"""What the sections share: figures as they stand in a page, colours, rows of margins."""

import math

from matplotlib.figure import Figure

from delaytools.analysis.margins import Margins
from delaytools.report.contents import Contents
from delaytools.report.page import Drawn
from delaytools.report.style import colours, svg_text
from delaytools.report.words import degrees, hertz, milliseconds, number, ratio_and_decibels, why

__all__ = ["JUDGED", "MARGIN_HEADS", "MARK", "drawn", "look", "margin_cells", "margin_words", "troubles"]

JUDGED = {
    "optimistic": "OPTIMISTIC",
    "unstable": "UNSTABLE",
    "as flight": "as flight",
    "pessimistic": "less than flight",
    "stable": "stable",
}

MARK = {"optimistic": "warn", "unstable": "bad"}

MARGIN_HEADS = (
    "Loop", "Stable", "Gain margin", "dB", "Phase margin, deg", "at Hz", "Delay margin, ms", "Modulus margin", "Bench",
)  # fmt: skip


def drawn(figure: Figure, name: str, caption: str) -> Drawn:
    """A figure as it stands in a page."""
    return Drawn(name, caption, svg_text(figure, name), float(figure.get_size_inches()[0]) * 72)


def look(contents: Contents) -> dict[str, str]:
    """The colour of each configuration."""
    return colours([case.name for case in contents.cases])


def troubles(contents: Contents, section: str) -> tuple[str, ...]:
    """What could not be answered for a section."""
    return tuple(item.words for item in contents.troubles if item.section == section)


def margin_cells(name: str, m: Margins, last: str) -> tuple[str, ...]:
    ratio, decibels = ratio_and_decibels(m.gain_margin)
    if m.gain_margin is None:
        ratio = why(m, "gain_margin")
    return (
        name, "yes" if m.stable else "NO", ratio, decibels,
        degrees(m.phase_margin) if m.phase_margin is not None else why(m, "phase_margin"),
        hertz(m.phase_margin_frequency),
        milliseconds(m.delay_margin) if m.delay_margin is not None else why(m, "delay_margin"),
        number(m.modulus_margin) if m.modulus_margin is not None else why(m, "modulus_margin"), last,
    )  # fmt: skip


def margin_words(m: Margins) -> str:
    gain = "no gain limit" if m.gain_margin is None else f"{abs(20 * math.log10(m.gain_margin)):.1f} dB"
    delay = "no delay limit" if m.delay_margin is None else f"{m.delay_margin * 1e3:.1f} ms"
    return f"{gain} and {delay}"
