"""The sections that speak of margins: verdict, budget, margins against delay, Nyquist, compensation."""

import math

from matplotlib.figure import Figure

from delaytools.analysis.margins import Margins
from delaytools.report.budget import Budget, BudgetEntry
from delaytools.report.compensation import Compensation
from delaytools.report.contents import Contents
from delaytools.report.figure_budget import draw_budgets, draw_waterfall
from delaytools.report.figure_compensation import draw_compensation
from delaytools.report.figure_margins import draw_curves, draw_margins
from delaytools.report.figure_nyquist import draw_nyquist
from delaytools.report.page import Drawn, Section, Table
from delaytools.report.style import colours, svg_text
from delaytools.report.verdict import MarginRow
from delaytools.report.words import count, degrees, hertz, listed, milliseconds, number, percent, ratio_and_decibels, span, why

__all__ = ["budget_section", "compensation_section", "drawn", "look", "nyquist_section", "sweep_section", "tone", "verdict_section"]

_JUDGED = {
    "optimistic": "OPTIMISTIC",
    "unstable": "UNSTABLE",
    "as flight": "as flight",
    "pessimistic": "less than flight",
    "stable": "stable",
}
_MARK = {"optimistic": "warn", "unstable": "bad"}
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


def tone(contents: Contents) -> str:
    """The tone of the verdict."""
    if contents.verdict is None:
        return "warn"
    words = {row.judgement for row in contents.verdict.rows}
    return "bad" if "unstable" in words else "warn" if "optimistic" in words else "good"


def verdict_section(contents: Contents) -> Section:
    """Margins per configuration beside flight, in a paragraph, a table and a figure."""
    answer = contents.verdict
    if answer is None:
        words = troubles(contents, "margins") or ("No block lies on a feedback path: there are no margins.",)
        return Section("verdict", "Verdict", "No margins could be computed.", missing=words + contents.asked.missing)
    rows, marks = [], []
    for row in answer.rows:
        rows.append(_margin_cells(row.name, row.bench, _JUDGED[row.judgement]))
        marks.append(_MARK.get(row.judgement, ""))
        if row.flight is not None:
            rows.append(_margin_cells("   in flight", row.flight, ""))
            marks.append("quiet")
    table = Table(
        f"Loop opened at {answer.opened}, no extra delay. Gain margin: the factor nearest 1 at which stability is lost.",
        MARGIN_HEADS, tuple(rows), tuple(marks), (0, 1, 8),
    )  # fmt: skip
    figure = draw_margins(answer, _margins_message(answer.rows))
    caption = "Margins on the bench (dots) and of the loop that flies (ticks)."
    lead = _margins_message(answer.rows) + "."
    return Section(
        "verdict", "Verdict", lead, (_verdict_words(contents),), (drawn(figure, "margins", caption),), (table,),
        contents.asked.missing,
    )  # fmt: skip


def _margin_cells(name: str, m: Margins, last: str) -> tuple[str, ...]:
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


def _margins_message(rows: tuple[MarginRow, ...]) -> str:
    unstable = [row.name for row in rows if not row.bench.stable]
    optimistic = [row.name for row in rows if row.judgement == "optimistic"]
    if unstable and len(unstable) == len(rows):
        return "Every configuration is unstable"
    if unstable:
        words = f"{count(len(unstable), 'configuration')} of {len(rows)} unstable ({listed(unstable)})"
        return words + (f", {len(optimistic)} optimistic ({listed(optimistic)})" if optimistic else "")
    weakest = min(rows, key=lambda row: row.bench.modulus_margin or 0.0)
    words = "Stable" if len(rows) == 1 else "All stable"
    words += f"; {weakest.name} is weakest with {_margin_words(weakest.bench)}" if len(rows) > 1 else f" with {_margin_words(weakest.bench)}"
    return words + (f"; {listed(optimistic)} optimistic" if optimistic else "")


def _margin_words(m: Margins) -> str:
    gain = "no gain limit" if m.gain_margin is None else f"{abs(20 * math.log10(m.gain_margin)):.1f} dB"
    delay = "no delay limit" if m.delay_margin is None else f"{m.delay_margin * 1e3:.1f} ms"
    return f"{gain} and {delay}"


def _verdict_words(contents: Contents) -> str:
    answer = contents.verdict
    assert answer is not None
    rows, weak = answer.rows, answer.focus
    exact = {row.bench.sampling for row in rows}
    parts = [f"The loop was opened at {answer.opened} in {count(len(rows), 'configuration')}."]
    for row in rows:
        if row.judgement == "optimistic":
            parts.append(
                f"{row.name} is OPTIMISTIC: the bench shows more {listed(list(row.optimistic_in))} than the loop that "
                "flies, so it certifies a margin that the vehicle does not have."
            )
    if weak.flight is not None and weak.bench.stable and weak.flight.stable:
        parts.append(
            f"In {weak.name}, the weakest stable one, the bench leaves {_margin_words(weak.bench)} where flight has "
            f"{_margin_words(weak.flight)}: what it shows there is the bench's delay, not the vehicle's."
        )
    for row in rows:
        if not row.bench.stable and row.flight is not None and row.flight.stable:
            parts.append(
                f"{row.name} is unstable on the bench while the same loop is stable in flight: an oscillation there is "
                "no fault of the vehicle."
            )
        elif not row.bench.stable:
            parts.append(f"{row.name} is unstable.")
    sampling = "exact" if exact == {"exact"} else "the continuous approximation of a hold, at least in part"
    return " ".join([*parts, f"Delays are exact; sampling: {sampling}."])


def budget_section(contents: Contents) -> Section:
    """What each element costs, and what is left."""
    if not contents.budgets:
        return Section("budget", "Delay budget", "No delay budget could be drawn up.", missing=troubles(contents, "budget"))
    answer = contents.verdict
    assert answer is not None
    chosen = next((b for b in contents.budgets if b.name == answer.focus.name), contents.budgets[0])
    figures = [drawn(draw_waterfall(chosen, _waterfall_message(chosen)), "waterfall",
                     f"Element by element in {chosen.name}, each alone; hatched: bench equipment that does not fly.")]  # fmt: skip
    if len(contents.budgets) > 1:
        message = "What each configuration has spent, and what it has left"
        figures.insert(0, drawn(draw_budgets(contents.budgets, message), "budget",
                                "Delay of the elements in series round the loop, and the delay margin left."))  # fmt: skip
    lead = _budget_lead(chosen)
    note = (
        "The low-frequency delay of an element is -d(phase)/dω at ω = 0 of that element alone: τ of a delay, 2ζ/ωₙ of a "
        "second-order element, half a period of a hold that a continuous element reads (none where a block sampled at "
        "the same instants reads the sequence). A lag far slower than the crossover shapes the loop and is no delay of "
        "it; an element that another way round by-passes is not added."
    )
    return Section("budget", "Delay budget", lead, (note,), tuple(figures), (_budget_table(chosen),), troubles(contents, "budget"))


def _budget_lead(item: Budget) -> str:
    words = f"In {item.name} the elements in series carry {milliseconds(item.total)} ms of delay"
    if item.bench_total > 0:
        words += f", {milliseconds(item.bench_total)} ms of it ({percent(item.bench_total / item.total)}) bench equipment that does not fly"
    if item.delay_margin is None:
        return words + f"; delay margin: {item.why or 'none'}."
    return words + f"; the loop can stand {milliseconds(item.delay_margin)} ms more."


def _waterfall_message(item: Budget) -> str:
    named = [e for e in item.entries if e.added and e.delay]
    if not named:
        return f"{item.name}: no element acts as a delay at the crossover"
    largest = max(named, key=lambda e: e.delay or 0.0)
    return f"{item.name}: {largest.name} is the largest of {len(named)} delays, {(largest.delay or 0) * 1e3:.1f} of {item.total * 1e3:.1f} ms"


def _budget_table(item: Budget) -> Table:
    rows = [_entry_cells(entry) for entry in item.entries]
    marks = ["warn" if entry.bench else "" for entry in item.entries]
    rows.append(("sum of what is added", "", milliseconds(item.total), degrees(item.series_phase), "phase: all in series"))
    marks.append("sum")
    if item.loop_phase is not None:
        rest = math.remainder(item.loop_phase - item.series_phase, 2 * math.pi)
        rows.append(("other ways round", "", "–", degrees(rest), "what makes the sum the phase of L"))
        total = item.series_phase + rest
        rows.append(("phase of L", "", "–", degrees(total), f"phase margin {degrees(math.pi + total)} deg at {hertz(item.crossover)} Hz"))
        marks += ["", "sum"]
    return Table(
        f"Delay budget of {item.name}; phase at the gain crossover, {hertz(item.crossover)} Hz.",
        ("Element", "Kind", "Delay, ms", "Phase, deg", "Remark"), tuple(rows), tuple(marks), (0, 1, 4),
    )  # fmt: skip


def _entry_cells(entry: BudgetEntry) -> tuple[str, ...]:
    where = "bench; " if entry.bench else ""
    delay = milliseconds(entry.delay) if entry.added else (f"({milliseconds(entry.delay)})" if entry.delay else "–")
    return entry.name, entry.kind, delay, degrees(entry.phase), (where + entry.note).removesuffix("; ")


def sweep_section(contents: Contents) -> Section:
    """Margins against the delay at one place."""
    title_, place = "Margins against delay", contents.asked.place
    if not contents.curves:
        return Section("sweep", title_, "No sweep of delay could be computed.", missing=troubles(contents, "sweep"))
    lead = _sweep_lead(contents)
    figure = draw_curves(contents.curves, place, look(contents), lead.rstrip(".").partition(",")[0])
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
    if not ends:
        return f"Every loop stays stable up to {high * 1e3:.1f} ms at {contents.asked.place}."
    if len(contents.curves) == 1:
        return f"The loop is lost at {min(ends) * 1e3:.2f} ms at {contents.asked.place}."
    return f"The first loop is lost at {min(ends) * 1e3:.2f} ms at {contents.asked.place}, the last at {max(ends) * 1e3:.2f} ms."


def nyquist_section(contents: Contents) -> Section:
    """Nyquist curves."""
    if not contents.nyquist:
        return Section("nyquist", "Nyquist curves", "No Nyquist curve could be drawn.", missing=troubles(contents, "nyquist"))
    lead = _nyquist_lead(contents)
    figure = draw_nyquist(contents.nyquist, look(contents), lead.rstrip("."))
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


def compensation_section(contents: Contents) -> Section:
    """Margins before, after and in flight."""
    items = contents.compensations
    if not items:
        words = "No compensation was tuned, and no configuration only moves what [tuning] vary names."
        return Section("compensation", "Compensation", "There is no compensation to judge.", missing=(words,))
    optimistic = [item.name for item in items if item.judgement == "optimistic"]
    lead = _compensation_lead(items, optimistic)
    figure = draw_compensation(items, lead.rstrip(".").partition(";")[0])
    rows, marks = [], []
    for item in items:
        words = ", ".join(f"{path.removeprefix('parameters.')} {was} → {new}" for path, was, new in item.changed)
        rows.append(_margin_cells(f"{item.before_name}, before", item.before, ""))
        rows.append(_margin_cells(f"{item.name} ({words})", item.after, _JUDGED[item.judgement]))
        marks += ["", _MARK.get(item.judgement, "")]
        if item.flight is not None:
            rows.append(_margin_cells("   in flight", item.flight, ""))
            marks.append("quiet")
    table = Table("Margins before compensation, after it, and in flight.", MARGIN_HEADS, tuple(rows), tuple(marks), (0, 1, 8))
    note = (
        "A compensator should bring the bench back to flight. Margins beyond flight's are not a better compensator: the "
        "bench then certifies what the vehicle does not have."
    )
    return Section("compensation", "Compensation", lead, (note,), (drawn(figure, "compensation", "Before, after, and the loop that flies without any of the bench."),), (table,))


def _compensation_lead(items: tuple[Compensation, ...], optimistic: list[str]) -> str:
    parts = []
    for item in items:
        before, after = item.before.gain_margin, item.after.gain_margin
        if after is None:
            parts.append(f"{item.name} is {'unstable' if not item.after.stable else 'without gain limit'}")
        else:
            was = "an unstable loop" if before is None else f"{abs(20 * math.log10(before)):.1f}"
            parts.append(f"{item.name} moves the gain margin from {was} to {abs(20 * math.log10(after)):.1f} dB")
    more = f"; {listed(optimistic)} {'goes' if len(optimistic) == 1 else 'go'} beyond flight" if optimistic else ""
    return ", ".join(parts) + more + "."
