"""The verdict: margins of every configuration beside the loop that flies."""

from delaytools.report.contents import Contents
from delaytools.report.figure_margins import draw_margins
from delaytools.report.page import Section, Table
from delaytools.report.section_parts import (
    JUDGED,
    MARGIN_HEADS,
    MARK,
    drawn,
    margin_cells,
    margin_words,
    troubles,
)
from delaytools.report.verdict import MarginRow
from delaytools.report.words import count, listed

__all__ = ["tone", "verdict_section"]


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
        return Section(
            "verdict", "Verdict", "No margins could be computed.", missing=words + contents.asked.missing
        )
    rows, marks = [], []
    for row in answer.rows:
        rows.append(margin_cells(row.name, row.bench, JUDGED[row.judgement]))
        marks.append(MARK.get(row.judgement, ""))
        if row.flight is not None:
            rows.append(margin_cells("   in flight", row.flight, ""))
            marks.append("quiet")
    table = Table(
        f"Loop opened at {answer.opened}, no extra delay. Gain margin: the factor nearest 1 that ends stability.",
        MARGIN_HEADS, tuple(rows), tuple(marks), (0, 1, 8),
    )  # fmt: skip
    figure = draw_margins(answer, _compared(answer.rows))
    caption = "Margins on the bench (dots) and of the loop that flies (ticks)."
    lead = _margins_message(answer.rows) + "."
    return Section(
        "verdict", "Verdict", lead, (_verdict_words(contents),), (drawn(figure, "margins", caption),), (table,),
        contents.asked.missing,
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
    words += (
        f"; {weakest.name} is weakest with {margin_words(weakest.bench)}"
        if len(rows) > 1
        else f" with {margin_words(weakest.bench)}"
    )
    return words + (f"; {listed(optimistic)} optimistic" if optimistic else "")


def _compared(rows: tuple[MarginRow, ...]) -> str:
    """The figure's message: how many benches show less, as much, or more margin than flight."""
    if all(row.flight is None for row in rows):
        return f"Margins of {count(len(rows), 'configuration')}"
    less = sum(row.judgement in ("pessimistic", "unstable") for row in rows)
    more = sum(row.judgement == "optimistic" for row in rows)
    same = len(rows) - less - more
    words = [
        f"{number_of} {how}"
        for number_of, how in ((less, "less"), (same, "as much"), (more, "more"))
        if number_of
    ]
    return f"Margin beside flight: of {count(len(rows), 'bench', 'benches')} {listed(words)}"


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
    if weak.flight is not None and weak.judgement == "pessimistic":
        parts.append(
            f"In {weak.name}, the weakest stable one, the bench leaves {margin_words(weak.bench)} where flight has "
            f"{margin_words(weak.flight)}: the difference is the bench's, not the vehicle's."
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
