"""The section of limit cycles: what sustains an oscillation, and what a stable loop must not be pushed beyond."""

from delaytools.analysis.limit_cycles import LimitCycle
from delaytools.report.contents import Contents
from delaytools.report.cycles import CycleCurve, kind_of
from delaytools.report.figure_cycles import draw_cycles
from delaytools.report.page import Section, Table
from delaytools.report.section_parts import drawn, look, troubles
from delaytools.report.words import listed, number, percent

__all__ = ["cycles_section"]

Found = tuple[str, float, LimitCycle]


def cycles_section(contents: Contents) -> Section:
    """Limit cycles by describing functions, and what runs say of them."""
    heading, missing = "Limit cycles", troubles(contents, "cycles")
    curves = tuple(curve for curve in contents.cycles if curve.nonlinear)
    if not curves:
        lead = "Nothing in any loop depends on amplitude: what oscillates grows or dies out."
        sought = contents.cycles and not missing
        return Section("cycles", heading, lead if sought else "Limit cycles could not be sought.", missing=missing)
    found = [(name, tau, one) for curve in curves for name, tau, answer in curve.present for one in answer.cycles]
    at, place = contents.asked.at, contents.asked.place
    unit = contents.cases[0].loop.units.get(at, "")
    pieces = list(dict.fromkeys(name for curve in curves for name in curve.nonlinear))
    note = (
        f"Depending on amplitude: {listed(pieces)}. Each is replaced by the gain of its first harmonic, with exact "
        "delay; harmonics say how far that can be trusted. A cycle that lasts is checked by runs let go below and "
        "above it, which must both end there; another, by runs that must leave it on both sides. Of one that parts, "
        "what is smaller dies out and what is larger grows."
    )
    figures = ()
    if any(curve.lines for curve in curves):
        words = f"Amplitude of {at}" + (f" ({unit})" if unit else "")
        figure = draw_cycles(curves, words, place, look(contents), _message(curves, at))
        caption = f"Limit cycles against the delay at {place}, as predicted; the configurations as they stand."
        figures = (drawn(figure, "cycles", caption),)
    tables = (_table(found, at, unit),) if found else ()
    return Section("cycles", heading, _lead(found, unit, at), (note,), figures, tables, missing)


def _lead(found: list[Found], unit: str, at: str) -> str:
    words = []
    for name in dict.fromkeys(name for name, _, _ in found):
        own = [one for other, _, one in found if other == name]
        ends = " and ".join(_size(one, unit) for one in own if kind_of(one) == "lasts")
        edges = " or ".join(_size(one, unit) for one in own if kind_of(one) == "parts")
        if edges:
            beyond = f"grows beyond, to {ends}" if ends else "grows beyond"
            words.append(f"in {name} a swing of {at} dies out below {edges} and {beyond}")
        elif ends:
            words.append(f"{name} oscillates, {at} by {ends}")
    text = "; ".join(words or ["no configuration, as it stands, has a limit cycle that lasts or parts"])
    return f"{text[0].upper()}{text[1:]}." if not words or words[0].startswith("in ") else f"{text}."


def _size(one: LimitCycle, unit: str) -> str:
    doubt = " (simulation disagrees)" if one.check is not None and not one.check.agrees else ""
    return f"±{number(one.amplitude)} {unit}".rstrip() + f" at {one.frequency:.1f} Hz{doubt}"


def _message(curves: tuple[CycleCurve, ...], at: str) -> str:
    """Whether an oscillation lasts, and over which delays."""
    lasting = [(*line.delays[[0, -1]], curve.family.name) for curve in curves for line in curve.lines if line.lasts]
    if not lasting:
        return f"No oscillation lasts; where {at} swings beyond the dashed size, one grows"
    first, last, name = min(lasting)
    return f"An oscillation lasts from {first * 1e3:.3g} to {last * 1e3:.3g} ms, in {name}"


def _table(found: list[Found], at: str, unit: str) -> Table:
    rows, marks = [], []
    for name, tau, one in found:
        agrees = one.check is not None and one.check.agrees
        rows.append((
            name, f"{tau * 1e3:g}", number(one.amplitude), f"{one.frequency:.2f}", kind_of(one),
            percent(one.distortion), ", ".join(p.name for p in one.pieces if p.drives) or "–",
            "not run" if one.check is None else ("" if agrees else "disagrees: ") + one.check.words,
        ))  # fmt: skip
        marks.append({"lasts": "bad", "parts": "warn"}.get(kind_of(one), ""))
    heads = ("Configuration", "Delay, ms", f"Amplitude, {unit}".strip(", "), "Hz", "Kind", "Harmonics", "Driven by",
             "Simulation")  # fmt: skip
    return Table(f"Limit cycles of the configurations as they stand; amplitude of {at}.", heads, tuple(rows),
                 tuple(marks), (0, 4, 6, 7))  # fmt: skip
