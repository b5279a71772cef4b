"""Comparisons and diagnoses as lines of text for a terminal."""

import textwrap
from typing import Any

from delaytools.cli.words import number_cell, table_lines
from delaytools.design.knowledge import knowledge_of

__all__ = ["comparison_lines", "diagnosis_lines", "ladder_lines"]

MOST = 5


def comparison_lines(answer: Any) -> list[str]:
    """A row for every signal, then where the model fails, and the loop run from outside."""
    heads = ["signal", "unit", "rms error", "noise", "carried", "fit %", "shift ms", "rms after", "Theil", "verdict"]
    rows = [_row(one) for one in answer.signals]
    lines = [*table_lines(heads, rows), answer.where]
    lines += [f"{one.signal}: {one.reason}" for one in answer.signals if one.verdict == "fails"]
    lines += [f"{name} is not compared: {why}" for name, why in answer.not_compared.items()]
    for run in answer.closed_loop:
        fits = ", ".join(f"{name} {number_cell(fit)} %" for name, (_, fit) in run.figures.items())
        lines.append(f"closed loop from the external inputs of {run.log or 'the log'}: fit {fits}" if fits else "")
        lines.append(f"closed loop: {run.why}" if run.why else "")
    return [line for line in [*lines, *(f"note: {note}" for note in answer.notes)] if line]


def _row(one: Any) -> list[str]:
    figures = one.overall
    numbers = (
        number_cell(figures.rms_error), number_cell(one.noise_rms, form="{:.2g}"),
        number_cell(one.carried_noise_rms, form="{:.2g}"), number_cell(figures.fit_percent),
        number_cell(figures.shift.seconds, 1e3, "{:.3f}"), number_cell(figures.shift.error_after),
        number_cell(figures.theil.coefficient, form="{:.2g}"),
    )  # fmt: skip
    return [one.signal, one.unit, *numbers, "adequate" if one.verdict == "adequate" else "FAILS"]


def diagnosis_lines(answer: Any) -> list[str]:
    """The verdict, what is missing with what should be known of it, rivals, what is left, and the error's fall."""
    lines = [f"verdict: {answer.verdict}"]
    for one in answer.missing:
        lines += _missing_lines(one)
    for group in answer.confusable:
        lines.append(f"at {group.signal} these logs do not tell apart:")
        lines += [f"  {_named(m)} (χ² {m.delta_chi2:+.1f})" for m in group.members]
    for left in answer.unexplained:
        bands = ", ".join(f"{low:.3g} to {high:.3g} Hz" for low, high in left.stretches)
        lines.append(f"unexplained at {left.signal}: {100 * left.share_of_error:.1f} % of the squared error, {bands}")
        lines.append(f"  {left.hint}" if left.hint else "")
    if answer.next_experiment is not None:
        lines.append(f"next experiment: {answer.next_experiment.why}")
        lines.append(f"  {dict(answer.next_experiment.input)}" if answer.next_experiment.input else "")
    lines += ladder_lines(answer)
    lines += [f"inside its tolerance: {name} = {_quantity(item)}" for name, item in answer.tolerated.items()]
    lines += [f"note: {note}" for note in answer.notes]
    lines.append("the time given was over before every search was done" if answer.budget_exhausted else "")
    return [line for line in [*lines, f"{answer.seconds:.0f} s"] if line]


def _missing_lines(one: Any) -> list[str]:
    sure = "missing" if one.certain else "perhaps missing"
    lines = [f"{sure}: {_named(one)}, seen at {one.signal}"]
    if one.also_at:
        lines.append(f"  the same at {', '.join(one.also_at)}")
    known = knowledge_of(one.effect)
    pairs = (("what", known.what), ("cause", known.cause), ("margins", known.margins), ("check", known.check))
    for head, text in pairs:
        lines += textwrap.wrap(text, 100, initial_indent=f"  {head + ':':9}", subsequent_indent=" " * 11)
    return lines


def _named(one: Any) -> str:
    values = ", ".join(f"{name} = {_quantity(item)}" for name, item in one.parameters.items())
    words = ", ".join(f"{name} {value}" for name, value in one.settings.items() if isinstance(value, str))
    return f"{one.effect}@{one.at} ({', '.join(part for part in (values, words) if part)})"


def _quantity(item: Any) -> str:
    unit = f" {item.unit}" if item.unit else ""
    return f"{item.value:.5g} ± {number_cell(item.std, form='{:.2g}')}{unit}"


def _white(value: float | None) -> str:
    return number_cell(value, form="{:.3g}")


def ladder_lines(answer: Any) -> list[str]:
    """The held-out error of every signal that an effect helps, step by step; in brackets whitened, 1 = noise."""
    if not answer.ladder:
        return []
    first, last = answer.ladder[0], answer.ladder[-1]
    signals = [s for s in first.errors if any(step.errors.get(s) != first.errors[s] for step in answer.ladder)]
    signals = signals or [s for s in last.errors][:MOST]
    rows = [
        [step.step, *(f"{number_cell(step.errors.get(s))} ({_white(step.whitened.get(s))})" for s in signals)]
        for step in answer.ladder
    ]
    return ["held-out rms error (in brackets: whitened, 1 = noise)", *table_lines(["step", *signals], rows)]
