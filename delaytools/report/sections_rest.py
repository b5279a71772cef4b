"""The sections that do not speak of margins: diagram, root locus, runs, assumptions, limits of the report."""

import math

from delaytools.report.contents import Contents
from delaytools.report.figure_diagram import draw_diagram
from delaytools.report.figure_locus import draw_locus
from delaytools.report.figure_runs import draw_runs
from delaytools.report.locus import Locus
from delaytools.report.page import Section, Table
from delaytools.report.runs import Run, Runs
from delaytools.report.section_parts import drawn, look, troubles
from delaytools.report.words import count, listed, number

__all__ = ["assumptions_section", "diagram_section", "limits_section", "locus_section", "runs_section"]


def diagram_section(contents: Contents) -> Section:
    """The loop as a block diagram."""
    diagram = contents.diagram
    if diagram is None:
        return Section(
            "diagram",
            "The loop",
            "The block diagram could not be drawn.",
            missing=troubles(contents, "diagram"),
        )
    bench = [box.part.name for box in diagram.boxes if box.part.bench]
    lead = f"The loop has {count(len(diagram.boxes), 'block')}"
    lead += f", {len(bench)} of them bench equipment that does not fly ({listed(bench)})." if bench else "."
    note = (
        "Where configurations change a value, its range is written; effects stand under the box at whose port they "
        "act, in the configurations that have them."
    )
    caption = (
        f"The design's blocks and signals; the loop is opened at {contents.asked.at}."
        if contents.asked.at
        else "The design's blocks and signals."
    )
    return Section("diagram", "The loop", lead, (note,), (drawn(draw_diagram(diagram), "diagram", caption),))


def locus_section(contents: Contents) -> Section:
    """The rightmost roots as the delay grows."""
    if not contents.loci:
        return Section(
            "locus",
            "Root locus in delay",
            "No root locus could be drawn.",
            missing=troubles(contents, "locus"),
        )
    item = contents.loci[0]
    lead = _locus_lead(item, contents.asked.place)
    figure = draw_locus(item, contents.asked.place, _locus_message(item))
    notes = [
        f"Roots of {item.name}; sampling: {item.sampling}. Only roots with Im s ≥ 0 are drawn; rings mark the "
        "configurations as they stand."
    ]
    if not item.certified:
        notes.append(
            "At some delays the count that certifies the set of roots did not agree with the roots found."
        )
    caption = (
        "Rightmost characteristic roots, coloured by the delay; rays of equal damping ζ, circles of equal natural "
        "frequency."
    )
    return Section(
        "locus",
        "Root locus in delay",
        lead,
        tuple(notes),
        (drawn(figure, "locus", caption),),
        (),
        troubles(contents, "locus"),
    )


def _locus_lead(item: Locus, place: str) -> str:
    if not item.crossings:
        return f"No root crosses the axis for delays at {place} up to {item.span[1] * 1e3:.1f} ms."
    first = item.crossings[0]
    return (
        f"A pair of roots crosses the axis at {first.value * 1e3:.2f} ms, oscillating at "
        f"{first.frequency / (2 * math.pi):.2f} Hz."
    )


def _locus_message(item: Locus) -> str:
    """How the damping of the leading pair changes from the first delay on."""
    known = [found for delay in item.span if (found := _leading_damping(item, delay)) is not None]
    if not known:
        return "No oscillating root among the rightmost"
    end = (item.crossings[0].value, 0.0) if item.crossings else known[-1]
    first = f"{number(known[0][1], 2)} at {known[0][0] * 1e3:g} ms"
    return f"Damping of the leading pair: {first}, {number(end[1], 2)} at {end[0] * 1e3:.4g} ms"


def _leading_damping(item: Locus, delay: float) -> tuple[float, float] | None:
    """The delay and the damping there of the rightmost pair, at an end of the range."""
    ends = [one.roots[k] for one in item.branches for k in (0, -1) if one.values[k] == delay]
    pairs = [s for s in ends if s.imag > 1e-6 * abs(s)]
    leading = max(pairs, key=lambda s: s.real, default=None)
    return None if leading is None else (delay, -float(leading.real) / abs(leading))


def runs_section(contents: Contents) -> Section:
    """Runs of every configuration."""
    runs = contents.runs
    title_ = "Runs in time"
    if runs is None:
        missing = troubles(contents, "runs") or ("[inputs] is empty: nothing drives the loop.",)
        return Section("runs", title_, "No run was made.", missing=missing)
    lead = _runs_lead(runs)
    figure = draw_runs(runs, look(contents), _runs_message(runs))
    demand, answer = runs.demand
    inputs = contents.design.tables.inputs
    driven = ", ".join(f"{name} ({table.get('type')})" for name, table in inputs.items())
    notes = [
        f"Driven by {driven}; seed {runs.seed}; {runs.runs[0].seconds:g} s each, nonlinear, the first seconds drawn."
    ]
    if answer in runs.signals:
        notes.append(f"Dashed: {demand}. Columns share their axes.")
    rows = tuple(row for run in runs.runs for row in _run_rows(run, runs))
    marks = tuple("bad" if run.grows else "" for run in runs.runs for _ in runs.signals)
    table = Table(
        "Strongest oscillation in the last half of each run, and rms and peak of the whole run.",
        ("Configuration", "Signal", "Unit", "Oscillation ±", "at Hz", "rms", "Peak", "Remark"),
        rows, marks, (0, 1, 2, 7),
    )  # fmt: skip
    caption = (
        f"The first {runs.runs[0].record.time[-1]:g} s of every run." if len(runs.runs[0].record) else "Runs."
    )
    return Section(
        "runs",
        title_,
        lead,
        (" ".join(notes),),
        (drawn(figure, "runs", caption),),
        (table,),
        troubles(contents, "runs"),
    )


def _runs_lead(runs: Runs) -> str:
    growing = [run.name for run in runs.runs if run.grows]
    first = f"{listed(growing)} {'grows' if len(growing) == 1 else 'grow'} without bound" if growing else ""
    signal = runs.signals[-1]
    bounded = [run for run in runs.runs if not run.grows]
    rank = sorted(bounded, key=lambda run: run.figures[signal].oscillation_amplitude)
    if not rank:
        return f"{first}."
    unit = runs.units.get(signal, "")
    low, high = rank[0], rank[-1]
    words = [
        f"±{number(f.oscillation_amplitude, 2)} {unit} at {f.oscillation_frequency:.1f} Hz in {run.name}"
        for run in ((low, high) if low is not high else (high,))
        for f in (run.figures[signal],)
    ]
    return f"{first}{'; ' if first else ''}{signal} oscillates with {' and '.join(words)}."


def _runs_message(runs: Runs) -> str:
    bounded = [run for run in runs.runs if not run.grows]
    if not bounded:
        return "Every run grows without bound"
    if len(bounded) == 1:
        return f"Run of {bounded[0].name}"
    strongest = max(bounded, key=lambda run: run.figures[runs.signals[-1]].oscillation_amplitude)
    return f"Of the runs that stay bounded, {strongest.name} oscillates most"


def _run_rows(run: Run, runs: Runs) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for index, signal in enumerate(runs.signals):
        f = run.figures[signal]
        remark = (
            f"diverges: not finite from {run.diverged:.2f} s on"
            if run.diverged is not None
            else "grows"
            if run.grows
            else ""
        )
        rows.append((
            run.name if index == 0 else "", signal, runs.units.get(signal, ""), number(f.oscillation_amplitude),
            number(f.oscillation_frequency), number(f.rms), number(f.peak), remark,
        ))  # fmt: skip
    return rows


def assumptions_section(contents: Contents) -> Section:
    """The design's own words about its numbers."""
    found = contents.remarks
    if not found:
        missing = (
            "No comment of the design says 'assumed' or cites a source: the origin of its numbers is not known.",
        )
        return Section(
            "assumptions",
            "Assumptions and sources",
            "The design says nothing of where its numbers come from.",
            missing=missing,
        )
    assumed = sum(item.assumed for item in found)
    verb = "says" if assumed == 1 else "say"
    lead = f"{count(assumed, 'remark')} of the design {verb} assumed, {len(found) - assumed} cite a source."
    rows = tuple(
        (
            item.place,
            item.value if len(item.value) < 44 else item.value[:42] + "…",
            item.text,
            "assumed" if item.assumed else "cited",
        )
        for item in found
    )
    marks = tuple("warn" if item.assumed else "" for item in found)
    table = Table(
        "Comments of the design file that say assumed or cite a source.",
        ("Place", "Value", "Remark", ""),
        rows,
        marks,
        (0, 1, 2, 3),
    )
    return Section("assumptions", "Assumptions and sources", lead, (), (), (table,))


def limits_section(contents: Contents) -> Section:
    """What the report cannot say."""
    points = list(contents.asked.missing)
    answer = contents.verdict
    if answer is not None:
        without = dict.fromkeys(name for row in answer.rows for name in row.bench.linearised_without)
        if without:
            points.append(
                f"Margins, roots and Nyquist curves were computed without {listed(list(without))}: effects that "
                "depend on amplitude show in the runs and in the limit cycles alone."
            )
        for why in dict.fromkeys(row.why_approximate for row in answer.rows if row.why_approximate):
            points.append(
                f"Sampling is approximated by (1 - e^(-sT))/(sT) for a hold ({why}): good "
                "well below half the sampling frequency."
            )
    approximate = {item.sampling for item in contents.loci} - {"exact"}
    if approximate:
        points.append("The root locus uses the continuous approximation of the holds.")
    points.append(
        "Margins hold for one loop opened at one signal; a change in two places at once is not covered by them."
    )
    points.append("A run shows one seed and one set of inputs.")
    points += _measured_limits(contents)
    if any(item.assumed for item in contents.remarks):
        points.append("Every number that rests on an assumed value is as good as that assumption.")
    points += [item.words for item in contents.troubles]
    lead = f"{count(len(points), 'limit')} of what can be concluded from these pages."
    return Section("limits", "What this report cannot say", lead, (), (), (), tuple(points))


def _measured_limits(contents: Contents) -> list[str]:
    """What the logs leave open, or that there were none."""
    evidence = contents.evidence
    if evidence is None:
        return ["No log was given: nothing in these pages is compared with a measurement."]
    points = [
        "Pieces of the loop are driven by what was measured at their entries: blocks that lead to no measured signal "
        "are not judged by the logs."
    ]
    if evidence.diagnosis is None:
        points.append("No missing effect was searched for.")
    elif evidence.diagnosis.budget_exhausted:
        points.append("The search for missing effects ended when its time was over.")
    points += [f"{name} is not compared: {why}." for name, why in evidence.comparison.not_compared.items()]
    return points
