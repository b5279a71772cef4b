"""The sections of margins against delay and of Nyquist curves."""

from delaytools.report.contents import Contents
from delaytools.report.figure_margins import draw_curves
from delaytools.report.figure_nyquist import draw_nyquist
from delaytools.report.page import Section, Table
from delaytools.report.section_parts import drawn, look, troubles
from delaytools.report.words import count, listed, span

__all__ = ["nyquist_section", "sweep_section"]


def sweep_section(contents: Contents) -> Section:
    """Margins against the delay at one place."""
    title_, place = "Margins against delay", contents.asked.place
    if not contents.curves:
        return Section(
            "sweep", title_, "No sweep of delay could be computed.", missing=troubles(contents, "sweep")
        )
    lead = _sweep_lead(contents)
    figure = draw_curves(contents.curves, place, look(contents), _sweep_message(contents))
    rows = []
    for curve in contents.curves:
        stable = "; ".join(span(*pair) for pair in curve.stable) or "nowhere"
        present = "; ".join(f"{name} {tau * 1e3:g} ms" for name, tau in curve.family.members)
        rows.append((curve.family.name, present, stable, curve.sampling))
    table = Table(
        f"Delays at {place} between {span(*contents.span)} at which each loop is stable (inner ends are exact).",
        ("Configurations", "Delay as it stands", "Stable for", "Sampling"), tuple(rows), (), (0, 1, 2, 3),
    )  # fmt: skip
    note = (
        f"Configurations that differ in nothing but the delay at {place} share one curve, and the delay shown is the "
        "whole delay there; dots mark each configuration as it stands."
    )
    return Section("sweep", title_, lead, (note,), (drawn(figure, "sweep", f"Margins against the delay at {place}."),),
                   (table,), troubles(contents, "sweep"))  # fmt: skip


def _sweep_lead(contents: Contents) -> str:
    low, high = contents.span
    ends = [pair[1] for curve in contents.curves for pair in curve.stable if pair[1] < high]
    if not any(curve.stable for curve in contents.curves):
        return f"No loop is stable at any delay between {span(low, high)}."
    never = sum(not curve.stable for curve in contents.curves)
    kept = len(contents.curves) - len(ends) - never
    if not ends and not never:
        return f"Every loop stays stable up to {high * 1e3:.1f} ms at {contents.asked.place}."
    if not ends:
        return f"{kept} of {len(contents.curves)} loops stay stable up to {high * 1e3:.1f} ms, the others nowhere."
    if len(contents.curves) == 1:
        return f"The loop is lost at {min(ends) * 1e3:.2f} ms at {contents.asked.place}."
    first, last = (f"{tau * 1e3:.2f} ms" for tau in (min(ends), max(ends)))
    rest = f"; {kept} kept over the whole range" if kept > 0 else ""
    rest += f"; {never} stable nowhere in it" if never else ""
    return f"Loops are lost between {first} and {last} at {contents.asked.place}{rest}."


def _sweep_message(contents: Contents) -> str:
    high = contents.span[1]
    lost = [(c.stable[-1][1], c.family.name) for c in contents.curves if c.stable and c.stable[-1][1] < high]
    if not lost:
        return (
            "No loop is lost inside the sweep" if any(c.stable for c in contents.curves) else "Stable nowhere"
        )
    if len(contents.curves) == 1:
        return f"Margins fall to nothing at {min(lost)[0] * 1e3:.2f} ms"
    words = f"First to be lost: {min(lost)[1]}"
    kept = [c.family.name for c in contents.curves if c.stable and c.stable[-1][1] >= high]
    return words + (f"; kept to {high * 1e3:g} ms: {listed(kept)}" if kept else "")


def nyquist_section(contents: Contents) -> Section:
    """Nyquist curves."""
    if not contents.nyquist:
        return Section(
            "nyquist",
            "Nyquist curves",
            "No Nyquist curve could be drawn.",
            missing=troubles(contents, "nyquist"),
        )
    lead = _nyquist_lead(contents)
    figure = draw_nyquist(
        contents.nyquist,
        look(contents),
        f"L(jω) of {count(len({c.name for c in contents.nyquist}), 'loop')} and the critical point",
    )
    caption = (
        "L(jω) with its delays exact. Dotted: unit circle; red cross: the point -1; red circle: the smallest modulus "
        "margin. Curves leave the frame where |L| is large."
    )
    return Section("nyquist", "Nyquist curves", lead, (), (drawn(figure, "nyquist", caption),), (),
                   troubles(contents, "nyquist"))  # fmt: skip


def _nyquist_lead(contents: Contents) -> str:
    bench = [c for c in contents.nyquist if not c.flies]
    nearest = min(bench, key=lambda c: (not c.stable, c.modulus))
    words = f"{nearest.name} passes the critical point at a distance of {nearest.modulus:.3f}"
    words += "" if nearest.stable else ", on the wrong side"
    flies = next((c for c in contents.nyquist if c.flies and c.name == nearest.name), None)
    words += f", in flight it keeps {flies.modulus:.3f}" if flies is not None else ""
    lost = [c.name for c in bench if not c.stable and c is not nearest]
    return words + (f"; {listed(lost)} passes it on the wrong side." if lost else ".")
