"""The section of compensation: margins before, after, and in flight."""

import math

from delaytools.report.compensation import Compensation
from delaytools.report.contents import Contents
from delaytools.report.figure_compensation import draw_compensation
from delaytools.report.page import Section, Table
from delaytools.report.section_parts import JUDGED, MARGIN_HEADS, MARK, drawn, margin_cells
from delaytools.report.words import listed

__all__ = ["compensation_section"]


def compensation_section(contents: Contents) -> Section:
    """Margins before, after and in flight."""
    items = contents.compensations
    if not items:
        words = "No compensation was tuned, and no configuration only moves what [tuning] vary names."
        return Section("compensation", "Compensation", "There is no compensation to judge.", missing=(words,))
    optimistic = [item.name for item in items if item.judgement == "optimistic"]
    lead = _compensation_lead(items, optimistic)
    figure = draw_compensation(items, "What compensation gives back, beside what flight has")
    rows, marks = [], []
    for item in items:
        words = ", ".join(
            f"{path.removeprefix('parameters.')} {was} → {new}" for path, was, new in item.changed
        )
        rows.append(margin_cells(f"{item.before_name}, before", item.before, ""))
        rows.append(margin_cells(f"{item.name} ({words})", item.after, JUDGED[item.judgement]))
        marks += ["", MARK.get(item.judgement, "")]
        if item.flight is not None:
            rows.append(margin_cells("   in flight", item.flight, ""))
            marks.append("quiet")
    table = Table(
        "Margins before compensation, after it, and in flight.",
        MARGIN_HEADS,
        tuple(rows),
        tuple(marks),
        (0, 1, 8),
    )
    note = (
        "A compensator should bring the bench back to flight. Margins beyond flight's are not a better compensator: "
        "the bench then certifies what the vehicle does not have."
    )
    return Section(
        "compensation",
        "Compensation",
        lead,
        (note,),
        (drawn(figure, "compensation", "Before, after, and the loop that flies without any of the bench."),),
        (table,),
    )


def _compensation_lead(items: tuple[Compensation, ...], optimistic: list[str]) -> str:
    parts = []
    for item in items:
        before, after = item.before.gain_margin, item.after.gain_margin
        if after is None:
            parts.append(f"{item.name} is {'unstable' if not item.after.stable else 'without gain limit'}")
        else:
            was = "an unstable loop" if before is None else f"{abs(20 * math.log10(before)):.1f}"
            parts.append(
                f"{item.name} moves the gain margin from {was} to {abs(20 * math.log10(after)):.1f} dB"
            )
    more = (
        f"; {listed(optimistic)} {'goes' if len(optimistic) == 1 else 'go'} beyond flight"
        if optimistic
        else ""
    )
    return ", ".join(parts) + more + "."
