"""A predicted limit cycle put to the test: the nonlinear loop set swinging beside it, let go, and watched."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from delaytools.blocks.formula import FormulaBlock
from delaytools.loop.edit import cut, reader
from delaytools.loop.loop import Element, Loop
from delaytools.signals.expression import Expression, signal_expression
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Formula, Pulse, Stimulus
from delaytools.simulation.simulate import simulate, strongest_line

__all__ = ["Checked", "Predicted", "checked"]

DRIVE, GATE = "drive@cycle", "gate@cycle"
BESIDE = (0.7, 1.4)  # of the predicted amplitude: where the loop is let go
DRIVEN = 12  # periods
FEWEST, MOST = 40, 400  # periods watched
TIMES = 6.0  # times the predicted time constant that are watched
ALIKE = 0.25  # of the predicted amplitude, or frequency: what an end may differ and still be the predicted cycle
STEPS = 40  # of a period at least


@final
@dataclass(frozen=True)
class Predicted:
    """amplitude at the opened signal, frequency in Hz, growth in 1/s (`cycle_stability.growth`), whether it lasts."""

    amplitude: float
    frequency: float
    growth: float
    stable: bool


@final
@dataclass(frozen=True)
class Checked:
    """What simulation says. amplitude, frequency (Hz): where the runs that were let go beside it ended (NaN: nowhere).

    agrees: a cycle that should last was reached from below and from above, one that should not was left; words: which.
    """

    agrees: bool
    amplitude: float
    frequency: float
    words: str


@final
@dataclass(frozen=True)
class _Run:
    start: float  # amplitudes behind the release and at the end, 0 where it has died out, inf where it diverged
    end: float
    frequency: float


def checked(loop: Loop, at: str, predicted: Predicted) -> Checked:
    """The loop's own runs, driven at `at` by a sine of 0.7 and 1.4 of the predicted size and then let go.

    Nothing else drives it. Rows at the loop's frame, or finer where a period has fewer than 40 frames.
    """
    below, above = (_run(loop, at, predicted, factor) for factor in BESIDE)
    if predicted.stable:
        return _lasting(predicted, below, above)
    return _parting(predicted, below, above)


def _lasting(predicted: Predicted, below: _Run, above: _Run) -> Checked:
    ends = np.array([below.end, above.end])
    if not np.all(np.isfinite(ends)):
        return Checked(False, float("nan"), float("nan"), "the simulated loop diverges")
    amplitude, frequency = float(ends.mean()), 0.5 * (below.frequency + above.frequency)
    if np.ptp(ends) > ALIKE * predicted.amplitude:
        words = f"no common end: let go below it ends at {ends[0]:.4g}, above at {ends[1]:.4g}"
        return Checked(False, float("nan"), float("nan"), words)
    far = abs(amplitude - predicted.amplitude) > ALIKE * predicted.amplitude
    if far or not abs(frequency - predicted.frequency) <= ALIKE * predicted.frequency:
        words = f"from below and above it ends at {amplitude:.4g}, {frequency:.4g} Hz"
        return Checked(False, amplitude, frequency, words)
    return Checked(True, amplitude, frequency, "reached from below and from above")


def _parting(predicted: Predicted, below: _Run, above: _Run) -> Checked:
    """Left on both sides: each run moves away from the cycle, or passes it and ends beyond."""
    low, high = (1 - ALIKE) * predicted.amplitude, (1 + ALIKE) * predicted.amplitude
    left = (below.end < below.start or below.end > high) and (above.end > above.start or above.end < low)
    ends = f"let go below it goes to {below.end:.4g}, above to {above.end:.4g}"
    words = f"left on both sides: {ends}" if left else f"not left on both sides: {ends}"
    return Checked(left, float("nan"), float("nan"), words)


def _run(loop: Loop, at: str, predicted: Predicted, factor: float) -> _Run:
    period = 1.0 / predicted.frequency
    driven = DRIVEN * period
    slow = TIMES / abs(predicted.growth) if np.isfinite(predicted.growth) and predicted.growth else 0.0
    watched = float(np.clip(slow, FEWEST * period, MOST * period))
    stimuli: dict[str, Stimulus] = {
        DRIVE: Formula(
            formula=Expression("a*sin(w*t)*min(1, t/rise)"),
            values={"a": factor * predicted.amplitude, "w": 2 * np.pi * predicted.frequency, "rise": 5 * period},
        ),
        GATE: Pulse(amplitude=1.0, width=driven),
    }  # fmt: skip
    gated = _gated(loop, at)
    fine = int(np.ceil(loop.frame * STEPS / period))
    run = simulate(replace(gated, frame=loop.frame / fine), stimuli, duration=driven + watched)
    if run.diverged is not None:
        return _Run(factor * predicted.amplitude, np.inf, float("nan"))
    start = _swing(run.record, at, (driven, driven + 4 * period))
    end = _swing(run.record, at, (driven + 0.8 * watched, driven + watched))
    return _Run(start[0], end[0], end[1])


def _gated(loop: Loop, at: str) -> Loop:
    """The loop whose readers of a signal read a drive while the gate is 1, and the signal itself while it is 0."""
    opened = cut(loop, at)
    block = FormulaBlock(formula=Expression("gate*drive + (1 - gate)*u"), sources=("drive", "gate"))
    inputs = {"input": signal_expression(at), "drive": signal_expression(DRIVE), "gate": signal_expression(GATE)}
    switch = Element("switch@cycle", block, inputs, {"output": reader(at)})
    return replace(opened, elements=(*opened.elements, switch))


def _swing(record: Record, name: str, span: tuple[float, float]) -> tuple[float, float]:
    """Amplitude and frequency (Hz) of the strongest line within a span of time."""
    inside = (record.time >= span[0]) & (record.time <= span[1])
    return strongest_line(record.time[inside], record[name][inside])
