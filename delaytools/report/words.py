"""Numbers as the report writes them."""

import math

from delaytools.analysis.margins import Margins

__all__ = [
    "count",
    "degrees",
    "hertz",
    "listed",
    "milliseconds",
    "number",
    "percent",
    "ratio_and_decibels",
    "span",
    "why",
]


def number(value: float | None, digits: int = 3) -> str:
    """A number with so many significant digits; a dash where there is none."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞"
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-3 <= abs(value) < 1e6:
        text = f"{value:.0f}"
    return text.replace("-", "−") if "e" not in text else text


def milliseconds(value: float | None) -> str:
    """Seconds written in ms with two decimals."""
    return "–" if value is None or not math.isfinite(value) else f"{value * 1e3:.2f}"


def degrees(value: float | None) -> str:
    """Radians written in deg with one decimal."""
    return (
        "–" if value is None or not math.isfinite(value) else f"{math.degrees(value):.1f}".replace("-", "−")
    )


def hertz(value: float | None) -> str:
    """rad/s written in Hz with two decimals."""
    return "–" if value is None or not math.isfinite(value) else f"{value / (2 * math.pi):.2f}"


def ratio_and_decibels(value: float | None) -> tuple[str, str]:
    """A gain as a ratio and in dB."""
    if not value:
        return "–", "–"
    return f"{value:.3f}", f"{20 * math.log10(value):+.2f}".replace("-", "−")


def percent(share: float) -> str:
    """A share in percent."""
    return f"{100 * share:.0f} %"


def listed(names: list[str]) -> str:
    """a, b and c."""
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]


def count(number_of: int, singular: str, plural: str = "") -> str:
    """1 configuration, 3 configurations."""
    return f"{number_of} {singular if number_of == 1 else plural or singular + 's'}"


def span(low: float, high: float) -> str:
    """Two times in s as an interval in ms."""
    return f"{low * 1e3:.2f} to {high * 1e3:.2f} ms"


def why(margins: Margins, name: str) -> str:
    """Why a margin is missing, in a word."""
    return {"closed loop unstable": "unstable", "never": "∞"}.get(margins.why.get(name, ""), "–")
