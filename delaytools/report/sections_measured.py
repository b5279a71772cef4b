"""The section that holds the model against the logs, signal by signal."""

from delaytools.measurement.comparison import Comparison, SignalComparison
from delaytools.report.contents import Contents
from delaytools.report.evidence import Evidence
from delaytools.report.figure_measured import draw_measured
from delaytools.report.figure_strips import draw_strips
from delaytools.report.page import Section, Table
from delaytools.report.section_parts import drawn
from delaytools.report.words import count, listed, number

__all__ = ["measured_section"]

DRAWN = 6  # signals that get a figure of their own, failing ones first


def measured_section(contents: Contents) -> Section:
    """Every measured signal against the model: figures, a table, and where the error lies."""
    evidence = contents.evidence
    assert evidence is not None
    comparison = evidence.comparison
    signals = comparison.signals
    key, name = "measured", "Model against measurement"
    missing = tuple(f"{signal} is not compared: {why}." for signal, why in comparison.not_compared.items())
    if not signals:
        return Section(key, name, "No measured signal could be compared.", missing=missing)
    ranked = sorted(signals, key=lambda one: one.verdict == "adequate")
    figures = [
        drawn(draw_measured(one, _message(one)), f"measured_{one.signal}", _caption(one, evidence))
        for one in ranked[:DRAWN]
    ]
    strips = draw_strips(signals, "Where the error stands above its noise")
    caption = (
        "Error of every signal in units of its noise, over time, over frequency, and over amplitude and rate of the "
        "model's signal (bins of equal time)."
    )
    figures.append(drawn(strips, "error_strips", caption))
    paragraphs = (_where(comparison), *_closed_loop(comparison), *_notes(comparison))
    return Section(key, name, _lead(evidence), paragraphs, tuple(figures), (_table(signals),), missing)


def _lead(evidence: Evidence) -> str:
    signals = evidence.comparison.signals
    failing = [one.signal for one in signals if one.verdict == "fails"]
    of = f"{count(len(signals), 'measured signal')} of {listed(list(evidence.logs))}"
    if not failing:
        return f"The model explains {of} within the noise."
    return f"Of {of}, the model fails at {listed(failing)}."


def _where(comparison: Comparison) -> str:
    return (
        "Each measured signal was computed from what was measured at the entries of its piece of the loop alone, so an "
        f"error stays where it arises. The result: {comparison.where}."
    )


def _closed_loop(comparison: Comparison) -> list[str]:
    found = []
    for run in comparison.closed_loop:
        fits = [f"{name} {number(fit)} %" for name, (_, fit) in run.figures.items() if fit is not None]
        if fits:
            found.append(f"The whole loop run from the external inputs of the log alone fits {listed(fits)}.")
        if run.why:
            found.append(f"The whole loop run from the external inputs: {run.why}.")
    return list(dict.fromkeys(found))


def _notes(comparison: Comparison) -> list[str]:
    return [f"Note: {'; '.join(comparison.notes)}."] if comparison.notes else []


def _message(one: SignalComparison) -> str:
    unit = f" {one.unit}" if one.unit else ""
    error, noise = f"{number(one.rms_error)}{unit}", f"{number(one.explained_rms)}{unit}"
    if one.verdict == "adequate":
        return f"{one.signal} is explained: {error} rms of error, {noise} of noise"
    return f"{one.signal} is not explained: {error} rms of error, {noise} of noise"


def _caption(one: SignalComparison, evidence: Evidence) -> str:
    first = evidence.logs[0] if evidence.logs else "the log"
    driven = listed(list(one.driven_by)) if one.driven_by else "nothing"
    return f"{one.signal} in {first}, the model driven by measured {driven}."


def _table(signals: tuple[SignalComparison, ...]) -> Table:
    rows = []
    for one in signals:
        f = one.overall
        later = "–" if f.shift.seconds is None else f"{1e3 * f.shift.seconds:.3f}".replace("-0.000", "0.000")
        rows.append((
            one.signal, one.unit, number(f.rms_error), number(one.noise_rms, 2), number(one.carried_noise_rms, 2),
            number(f.fit_percent, 4), number(f.theil.coefficient, 2), later, number(f.shift.error_after),
            "FAILS" if one.verdict == "fails" else "adequate",
        ))  # fmt: skip
    marks = tuple("bad" if one.verdict == "fails" else "" for one in signals)
    heads = (
        "Signal", "Unit", "rms error", "Noise", "Carried", "Fit, %", "Theil", "Best shift, ms", "rms after it", "",
    )  # fmt: skip
    caption = (
        "Noise: of the signal itself, found without a model. Carried: what the noise of measured inputs sends to it. "
        "Best shift: the pure delay (positive: the measurement comes later) that fits best, and the error then."
    )
    return Table(caption, heads, tuple(rows), marks, (0, 1, 9))
