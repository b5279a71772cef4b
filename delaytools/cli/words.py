"""Answers as lines of text for a terminal."""

import math
from collections.abc import Mapping
from typing import Any

__all__ = [
    "allowance_lines", "disk_lines", "each_lines", "fit_lines", "jitter_lines", "margin_lines", "number_cell",
    "rest_lines", "root_lines", "run_lines", "table_lines", "tuned_lines",
]  # fmt: skip


def number_cell(value: float | None, scale: float = 1.0, form: str = "{:.4g}") -> str:
    """A number as a table shows it; a dash where there is none."""
    return "-" if value is None or not math.isfinite(value) else form.format(value * scale)


def table_lines(heads: list[str], rows: list[list[str]]) -> list[str]:
    """Heads and rows in columns, set to the right."""
    widths = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
    return [
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in [heads, *rows]
    ]


def margin_lines(answer: Any) -> list[str]:
    """The margins as a table, then the stable intervals."""
    heads = [
        "delay ms",
        "stable",
        "gain margin",
        "at Hz",
        "phase margin deg",
        "at Hz",
        "delay margin ms",
        "modulus",
        "disk",
    ]
    rows = []
    for m in answer.margins:
        hertz = 1 / (2 * math.pi)
        rows.append(
            [
                number_cell(m.delay, 1e3),
                "yes" if m.stable else "NO",
                number_cell(m.gain_margin),
                number_cell(m.gain_margin_frequency, hertz),
                number_cell(m.phase_margin, 180 / math.pi),
                number_cell(m.phase_margin_frequency, hertz),
                number_cell(m.delay_margin, 1e3),
                number_cell(m.modulus_margin),
                number_cell(m.disk_margin),
            ]
        )
    first = answer.margins[0]
    lines = [
        f"opened at {answer.at}, extra delay at {answer.delay_at or answer.at}; sampling: {first.sampling}"
    ]
    if answer.why_approximate:
        lines.append(f"  ({answer.why_approximate})")
    if first.linearised_without:
        lines.append("linearised without " + ", ".join(first.linearised_without))
    spans = [f"{low * 1e3:.6g} to {high * 1e3:.6g} ms" for low, high in answer.stable_delays]
    return [
        *lines,
        *table_lines(heads, rows),
        "stable for delays " + (", ".join(spans) if spans else "nowhere in the sweep"),
        *_small_delays(answer),
    ]


def allowance_lines(more: Any | None, at: str, delay_at: str | None) -> list[str]:
    """Stable gains and the jitter margin; nothing where they were not asked."""
    if more is None:
        return []
    spans = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in more.gains.stable)
    within = "{:.4g} to {:.4g}".format(*more.gains.looked_at)
    lines = [f"stable for gains of {at}, times: {spans or 'none'} (of {within})"]
    if more.jitter is not None:
        taken = "" if more.jitter_sampling == "exact" else ", holds taken as continuous"
        place, span = delay_at or at, more.jitter.margin * 1e3
        varies = "at will" if math.isinf(more.rate) else f"by {more.rate:g} s per s at most"
        lines.append(f"a delay at {place} that varies {varies} may add up to {span:.4g} ms{taken}")
    return [*lines, *_approximation(more)]


def each_lines(margins: Mapping[str, Any]) -> list[str]:
    """The margins at several signals, each opened while all other loops are closed; nothing where none was asked."""
    if not margins:
        return []
    heads = ["one at a time", "stable", "gain margin", "at Hz", "phase margin deg", "at Hz", "delay margin ms"]
    hertz = 1 / (2 * math.pi)
    rows = [
        [name, "yes" if m.stable else "NO", number_cell(m.gain_margin), number_cell(m.gain_margin_frequency, hertz),
         number_cell(m.phase_margin, 180 / math.pi), number_cell(m.phase_margin_frequency, hertz),
         number_cell(m.delay_margin, 1e3)]
        for name, m in margins.items()
    ]  # fmt: skip
    return table_lines(heads, rows)


def rest_lines(rest: Any, units: Mapping[str, str]) -> list[str]:
    """Where the loop rests, about which it was asked; nothing where that is zero."""
    if not rest.is_off_zero:
        return []
    least = 1e-9 * max(map(abs, rest.signals.values()))
    shown = {name: value for name, value in rest.signals.items() if abs(value) > least}
    return ["about the rest at " + ", ".join(f"{k} {x:.6g} {units.get(k, '')}".rstrip() for k, x in shown.items())]


def jitter_lines(lost: Any | None) -> list[str]:
    """With how little a run was lost, or that none was with less than a constant delay; nothing where none was made."""
    if lost is None:
        return []
    if not lost.frequency:
        return [f"no run was lost with less than the delay margin of {lost.lost * 1e3:.4g} ms"]
    how = f"{lost.shape} at {lost.frequency:.4g} Hz"
    return [f"lost in a run with {lost.lost * 1e3:.4g} ms ({how}): what it bears lies between"]


def _approximation(more: Any) -> list[str]:
    """What the continuous approximation of an exact sampled loop says, and how far off that is."""
    if more.approximate is None:
        return []
    shown = (("gain margin", "gain_margin", 1.0, ""), ("phase margin", "phase_margin", 180 / math.pi, " deg"),
             ("delay margin", "delay_margin", 1e3, " ms"), ("modulus", "modulus_margin", 1.0, ""))  # fmt: skip
    words = []
    for name, key, scale, unit in shown:
        exact, other = getattr(more.exact, key), getattr(more.approximate, key)
        if exact is None or other is None:
            continue
        off = 100 * (other / exact - 1) if exact else math.nan
        words.append(f"{name} {other * scale:.4g}{unit} ({off:+.2g} %)")
    return [f"holds taken as (1 - e^(-sT))/(sT) instead: {', '.join(words)}"] if words else []


def disk_lines(disk: Any | None) -> list[str]:
    """The disk margin of several signals at once; nothing where none was asked."""
    if disk is None:
        return []
    names = ", ".join(disk.signals)
    if disk.margin == 0.0:
        return [f"{names} together: no margin, the loop is unstable"]
    gain = "any gain" if math.isinf(disk.gain) else f"gains of {1 / disk.gain:.4g} to {disk.gain:.4g}"
    return [f"{names} together: disk margin {disk.margin:.4g} at {disk.frequency / (2 * math.pi):.4g} Hz: {gain} and "
            f"phases within {math.degrees(disk.phase):.4g} deg, each its own"]  # fmt: skip


def _small_delays(answer: Any) -> list[str]:
    return [f"careful: {answer.small_delays}"] if answer.small_delays else []


def root_lines(answer: Any) -> list[str]:
    """The rightmost roots of every set."""
    unit, scale = ("ms", 1e3) if answer.parameter == "delay" else ("", 1.0)
    lines = [f"rightmost characteristic roots in rad/s; sampling: {answer.sampling}"]
    for item in answer.sets:
        mark = "certified" if item.certified else f"NOT certified: {item.why}"
        lines.append(f"{answer.parameter} {item.parameter * scale:.6g} {unit} ({mark})".replace("  ", " "))
        for root in item.roots.tolist():
            if root.imag >= 0:
                damping = -root.real / abs(root) if root else 1.0
                hertz = abs(root) / (2 * math.pi)
                lines.append(
                    f"  {root.real:+12.5f} {root.imag:+12.5f}j   {hertz:8.3f} Hz  damping {damping:+.4f}"
                )
    return [*lines, *_small_delays(answer)]


def run_lines(answer: Any) -> list[str]:
    """Figures per signal."""
    units = answer.record.units
    heads = ["signal", "unit", "rms", "peak", "oscillation", "at Hz"]
    rows = [
        [
            name,
            units.get(name, ""),
            number_cell(f.rms),
            number_cell(f.peak),
            number_cell(f.oscillation_amplitude),
            number_cell(f.oscillation_frequency),
        ]
        for name, f in answer.figures.items()
    ]
    lines = table_lines(heads, rows)
    if answer.diverged is not None:
        lines.append(f"diverged: values were no longer finite from t = {answer.diverged:g} s on")
    lines.append(
        f"{answer.seconds_simulated:g} s simulated, {answer.real_time_factor:.0f} times faster than real time"
    )
    return lines


def tuned_lines(answer: Any) -> list[str]:
    """Values after and before, then every goal in a sentence."""
    rows = [
        [
            path,
            number_cell(item.value, form="{:.6g}"),
            number_cell(item.was, form="{:.6g}"),
            "end of range" if item.at_boundary else "",
        ]
        for path, item in answer.values.items()
    ]
    verdict = (
        []
        if not answer.optimistic
        else ["the bench now shows more margin than the loop that flies: it is optimistic"]
    )
    return [*table_lines(["value", "tuned", "was", ""], rows), *(goal.words for goal in answer.goals), *verdict]


def fit_lines(answer: Any) -> list[str]:
    """The fitted system, its values with standard errors, and what it is not."""
    names = ["natural_frequency", "damping", "gain", "delay"]
    units = {"natural_frequency": "rad/s", "delay": "s"}
    rows = [
        [
            n,
            number_cell(getattr(answer, n), form="{:.6g}"),
            number_cell(answer.std.get(n), form="{:.2g}"),
            units.get(n, ""),
        ]
        for n in names
    ]
    over = " ".join(f"{a:.6g}" for a in answer.denominator)
    head = f"numerator {answer.numerator[0]:.6g}, denominator {over}"
    return [head, *table_lines(["", "value", "std", "unit"], rows), answer.words]
