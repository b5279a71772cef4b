"""The section that says what is missing from the model, how sure that is, and what it does to the margins."""

from collections.abc import Mapping
from typing import Any

from delaytools.design.knowledge import knowledge_of
from delaytools.diagnosis.answer import Diagnosis, Missing, Quantity
from delaytools.report.contents import Contents
from delaytools.report.evidence import Improvement
from delaytools.report.figure_ladder import draw_ladder, helped
from delaytools.report.page import Drawn, Section, Table
from delaytools.report.section_parts import MARGIN_HEADS, drawn, margin_cells, margin_words, troubles
from delaytools.report.words import listed, number

__all__ = ["missing_section"]

RANKED = 6  # candidates listed per signal
TITLE = "What is missing"


def missing_section(contents: Contents) -> Section:
    """The diagnosis: effects, rivals, the error's fall, margins before and after, the next experiment."""
    evidence = contents.evidence
    assert evidence is not None
    found = evidence.diagnosis
    if found is None:
        return Section("missing", TITLE, "No missing effect was searched for.")
    units = {one.signal: one.unit for one in evidence.comparison.signals}
    figures: tuple[Drawn, ...] = ()
    if len(found.ladder) > 1:
        message = _ladder_message(found, units)
        caption = "Errors on data that were not used for the fit; in brackets whitened, 1 is noise alone."
        figures = (drawn(draw_ladder(found.ladder, units, message), "ladder", caption),)
    tables = [t for t in (_missing_table(found), _ranking(found), _margins(contents.improvement)) if t is not None]
    paragraphs = [*(_known(one) for one in found.missing), *_left(found), *_next(found), *_tolerated(found)]
    if contents.improvement is not None:
        paragraphs.append(_margin_sentence(contents.improvement))
    notes = tuple(f"{note}." for note in found.notes)
    left = (*troubles(contents, "missing"), *notes)
    return Section("missing", TITLE, _lead(found), tuple(paragraphs), figures, tuple(tables), left)


def _lead(found: Diagnosis) -> str:
    sure = [f"{one.effect} at {one.at}" for one in found.missing if one.certain]
    perhaps = [f"{one.effect} at {one.at}" for one in found.missing if not one.certain]
    parts = []
    if sure:
        parts.append(f"The model lacks {listed(sure)}.")
    if perhaps:
        parts.append(f"Perhaps it lacks {listed(perhaps)}: the logs leave it open.")
    if found.unexplained:
        signals = listed([one.signal for one in found.unexplained])
        cut_short = f"The search was over before all of {signals} was explained."
        parts.append(cut_short if found.budget_exhausted else f"No known effect explains all of {signals}.")
    return " ".join(parts) or "Nothing is missing from the model."


def _ladder_message(found: Diagnosis, units: Mapping[str, str]) -> str:
    first, last = found.ladder[0], found.ladder[-1]
    signals = helped(found.ladder)
    if not signals:
        return "No step changes the error"
    best = max(signals, key=lambda s: first.errors[s] / max(last.errors.get(s, first.errors[s]), 1e-300))
    fall = f"{number(first.errors[best])} to {number(last.errors[best])} {units.get(best, '')}".rstrip()
    return f"Held-out error of {best} falls from {fall}"


def quantity_words(parameters: Mapping[str, Quantity], settings: Mapping[str, Any]) -> str:
    """half_width 0.3001 ± 0.0003 deg, source fin_position."""
    parts = [
        f"{name} {number(item.value, 4)} ± {number(item.std, 2)} {item.unit}".rstrip()
        for name, item in parameters.items()
    ]
    return ", ".join([*parts, *(f"{name} {value}" for name, value in settings.items() if isinstance(value, str))])


def _missing_table(found: Diagnosis) -> Table | None:
    if not found.missing:
        return None
    sure = {True: "certain", False: "one of several"}
    rows = tuple(
        (one.effect, one.at, one.signal, quantity_words(one.parameters, one.settings), sure[one.certain])
        for one in found.missing
    )
    marks = tuple("" if one.certain else "warn" for one in found.missing)
    heads = ("Effect", "At", "Seen at", "Values", "")
    return Table("What the model lacks, with standard errors.", heads, rows, marks, (0, 1, 2, 3, 4))


def _ranking(found: Diagnosis) -> Table | None:
    shown = {one.signal for one in found.missing} | {one.signal for one in found.unexplained}
    shown |= {one.signal for one in found.confusable}
    rows = []
    for signal in (s for s in found.ranking if s in shown):
        for rank, rival in enumerate(found.ranking[signal][:RANKED]):
            rows.append((
                signal if rank == 0 else "", f"{rival.effect}@{rival.at}",
                quantity_words(rival.parameters, rival.settings), number(rival.held_out_rms, 4), number(rival.evidence),
                number(rival.delta_chi2),
            ))  # fmt: skip
    if not rows:
        return None
    caption = (
        "Candidates after their fit. Held out: whitened rms on data not used for the fit, 1 is noise alone. Evidence: "
        "χ² that it takes off held-out data. Behind: χ² worse than the best candidate."
    )
    heads = ("Signal", "Candidate", "Values", "Held out", "Evidence", "Behind")
    return Table(caption, heads, tuple(rows), (), (0, 1, 2))


def _margins(item: Improvement | None) -> Table | None:
    if item is None:
        return None
    names = listed([f"{one.missing.effect}@{one.missing.at}" for one in item.added])
    without = item.after.linearised_without
    caption = "Margins of the design as it stands, and with what the logs add to it."
    if without:
        caption += f" Linear margins leave out {listed(list(without))}: what depends on amplitude shows in runs alone."
    rows = (margin_cells("as designed", item.before, ""), margin_cells(f"with {names}", item.after, ""))
    marks = tuple("" if margins.stable else "bad" for margins in (item.before, item.after))
    return Table(caption, (*MARGIN_HEADS[:-1], ""), rows, marks, (0, 1, 8))


def _margin_sentence(item: Improvement) -> str:
    if not item.after.stable:
        return "With what the logs add, the linear loop is unstable."
    names = [f"{one.missing.effect}@{one.missing.at}" for one in item.added]
    if all(name in item.after.linearised_without for name in names):
        return f"Linear margins do not see {listed(names)}: what it does depends on amplitude, and shows in runs."
    words = f"With what the logs add, the loop keeps {margin_words(item.after)}"
    return f"{words}; as designed it has {margin_words(item.before)}."


def _known(one: Missing) -> str:
    known = knowledge_of(one.effect)
    words = f"{one.effect} at {one.at}. {known.what} Cause: {known.cause} Margins: {known.margins} "
    return words + f"How to check it: {known.check}"


def _left(found: Diagnosis) -> list[str]:
    words = []
    for one in found.unexplained:
        found_in = [f"{number(low)} to {number(high)} Hz" for low, high in one.stretches]
        bands = listed(found_in) if found_in else "no single band"
        hint = f" Hint: {one.hint.rstrip('.')}." if one.hint else ""
        share = f"{100 * one.share_of_error:.1f} % of the squared error"
        words.append(f"At {one.signal}, {share} stays unexplained ({bands}).{hint}")
    for group in found.confusable:
        names = [f"{m.effect}@{m.at} ({quantity_words(m.parameters, m.settings)})" for m in group.members]
        words.append(f"At {group.signal} these logs do not tell apart {listed(names)}.")
    return words


def _next(found: Diagnosis) -> list[str]:
    if found.next_experiment is None:
        return []
    asked = found.next_experiment.input  # empty, or what to measure, where no input would decide
    table = ", ".join(f"{name} = {value}" for name, value in asked.items() if name != "measure")
    return [f"Next experiment: {found.next_experiment.why.rstrip('.')}.{f' Input: {table}.' if table else ''}"]


def _tolerated(found: Diagnosis) -> list[str]:
    if not found.tolerated:
        return []
    return [f"Inside their tolerances the logs ask for {quantity_words(found.tolerated, {})}."]
