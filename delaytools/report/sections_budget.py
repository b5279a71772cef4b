"""The section of the delay budget."""

import math

from delaytools.report.budget import Budget, BudgetEntry
from delaytools.report.contents import Contents
from delaytools.report.figure_budget import draw_budgets, draw_waterfall
from delaytools.report.page import Section, Table
from delaytools.report.section_parts import drawn, troubles
from delaytools.report.words import count, degrees, hertz, milliseconds, percent

__all__ = ["budget_section"]


def budget_section(contents: Contents) -> Section:
    """What each element costs, and what is left."""
    if not contents.budgets:
        return Section(
            "budget",
            "Delay budget",
            "No delay budget could be drawn up.",
            missing=troubles(contents, "budget"),
        )
    answer = contents.verdict
    assert answer is not None
    chosen = next((b for b in contents.budgets if b.name == answer.focus.name), contents.budgets[0])
    words = f"Element by element in {chosen.name}, each alone; hatched: bench equipment that does not fly."
    figures = [drawn(draw_waterfall(chosen, _waterfall_message(chosen)), "waterfall", words)]
    if len(contents.budgets) > 1:
        message = "What each configuration has spent, and what it has left"
        words = "Delay of the elements in series round the loop, and the delay margin left."
        figures.insert(0, drawn(draw_budgets(contents.budgets, message), "budget", words))
    lead = _budget_lead(chosen)
    note = (
        "The low-frequency delay of an element is -d(phase)/dω at ω = 0 of that element alone: τ of a delay, 2ζ/ωₙ of "
        "a second-order element, half a period of a hold that a continuous element reads (none where a block sampled "
        "at the same instants reads the sequence). A lag far slower than the crossover shapes the loop and is no "
        "delay of it; an element that another way round by-passes is not added."
    )
    return Section(
        "budget",
        "Delay budget",
        lead,
        (note,),
        tuple(figures),
        (_budget_table(chosen),),
        troubles(contents, "budget"),
    )


def _budget_lead(item: Budget) -> str:
    words = f"In {item.name} the elements in series carry {milliseconds(item.total)} ms of delay"
    if item.bench_total > 0:
        share = percent(item.bench_total / item.total)
        words += f", {milliseconds(item.bench_total)} ms of it ({share}) bench equipment that does not fly"
    if item.delay_margin is None:
        return words + f"; delay margin: {item.why or 'none'}."
    return words + f"; the loop can stand {milliseconds(item.delay_margin)} ms more."


def _waterfall_message(item: Budget) -> str:
    named = [e for e in item.entries if e.added and e.delay]
    if not named:
        return f"{item.name}: no element acts as a delay at the crossover"
    largest = max(named, key=lambda e: e.delay or 0.0)
    if len(named) == 1:
        return f"{item.name}: {largest.name} is the only delay, {(largest.delay or 0) * 1e3:.1f} ms"
    share = f"{(largest.delay or 0) * 1e3:.1f} of {item.total * 1e3:.1f} ms"
    return f"{item.name}: {largest.name} is the largest of {count(len(named), 'delay')}, {share}"


def _budget_table(item: Budget) -> Table:
    rows = [_entry_cells(entry) for entry in item.entries]
    marks = ["warn" if entry.bench else "" for entry in item.entries]
    rows.append(
        (
            "sum of what is added",
            "",
            milliseconds(item.total),
            degrees(item.series_phase),
            "phase: all in series",
        )
    )
    marks.append("sum")
    if item.loop_phase is not None:
        rest = math.remainder(item.loop_phase - item.series_phase, 2 * math.pi)
        rows.append(("other ways round", "", "–", degrees(rest), "what makes the sum the phase of L"))
        total = item.series_phase + rest
        rows.append(
            (
                "phase of L",
                "",
                "–",
                degrees(total),
                f"phase margin {degrees(math.pi + total)} deg at {hertz(item.crossover)} Hz",
            )
        )
        marks += ["", "sum"]
    return Table(
        f"Delay budget of {item.name}; phase at the gain crossover, {hertz(item.crossover)} Hz.",
        ("Element", "Kind", "Delay, ms", "Phase, deg", "Remark"), tuple(rows), tuple(marks), (0, 1, 4),
    )  # fmt: skip


def _entry_cells(entry: BudgetEntry) -> tuple[str, ...]:
    where = "bench; " if entry.bench else ""
    delay = (
        milliseconds(entry.delay)
        if entry.added
        else (f"({milliseconds(entry.delay)})" if entry.delay else "–")
    )
    return entry.name, entry.kind, delay, degrees(entry.phase), (where + entry.note).removesuffix("; ")
