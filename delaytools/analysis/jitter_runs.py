"""How little a delay may vary and still lose a loop: found by runs, from above, beside what is certain from below."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.jitter import jitter_margin
from delaytools.analysis.margins import Sampling, margins
from delaytools.analysis.opened_loop import open_loop, writer_port
from delaytools.analysis.questions import APPROXIMATE
from delaytools.blocks.delay import SignalDelay
from delaytools.linear.algebra import delay
from delaytools.loop.edit import disturbed_at, insert
from delaytools.loop.linearise import without_amplitude_effects
from delaytools.loop.loop import Loop
from delaytools.loop.port import find_port
from delaytools.loop.values import resolve
from delaytools.signals.expression import signal_expression
from delaytools.signals.stimulus import Column, Pulse
from delaytools.signals.trouble import AnalysisError
from delaytools.simulation.simulate import simulate

__all__ = ["JitterRuns", "jitter_runs"]

Array = NDArray[np.float64]
VARYING = "delay@jitter"
PERIODS = 40  # of the crossover, that a run lasts
PER_PERIOD = 40  # frames at least
KICK = 4  # frames
TIMES = (0.5, 0.7, 1.0, 1.4, 1.7, 2.0, 2.25, 2.5, 2.8, 4.0)  # of the crossover frequency: how often the delay varies
Shape = Callable[[Array, float, float], Array]  # t, most (s), frequency (Hz) -> s
SHAPES: dict[str, Shape] = {
    "held, then followed": lambda t, most, f: np.minimum(np.mod(t, 1 / f), most),
    "a saw that falls": lambda t, most, f: most * (1 - np.mod(f * t, 1.0)),
    "a square wave": lambda t, most, f: most * (np.mod(f * t, 1.0) < 0.5),
    "a triangle": lambda t, most, f: most * (1 - np.abs(2 * np.mod(f * t, 1.0) - 1)),
}
NEARER, STEPS = 0.99, 6  # of the best so far: at which another is tried; halvings of what it is then found in


@final
@dataclass(frozen=True)
class JitterRuns:
    """certain: s below which no variation of the delay loses the loop. lost: the least with which it is lost.

    shape, frequency: how the delay varies then, between 0 and `lost` more than is there, and how often (Hz; 0: it is
    constant, by the delay margin, and no run was lost with less). sampling: of `certain` and the delay margin, which
    know holds as continuous ones alone; the runs know the samplers themselves.
    """

    certain: float
    lost: float
    shape: str
    frequency: float
    sampling: Sampling


def jitter_runs(
    loop: Loop, at: str, extra: float = 0.0, *, delay_at: str | None = None, rate: float = np.inf
) -> JitterRuns:
    """The jitter margin bracketed: from below by small gain, from above by runs of the linear loop.

    Delays that vary periodically at several frequencies about the crossover are tried, each as far down as it still
    makes a kicked loop grow; a constant delay of the delay margin is the first. "Held, then followed" holds one value
    until it is too old, the worst for an integrator (Myshkis 1951); with a bounded rate only triangles are tried.
    What other shapes would do is not known: the truth lies between. Raises AnalysisError where the loop is not stable.
    """
    opened = open_loop(loop, at, delay_at)
    around = opened.around_extra() * delay(extra)
    still = margins(around)
    if not still.stable or still.delay_margin is None or still.phase_margin_frequency is None:
        raise AnalysisError("a loop that no constant delay loses, or that is lost already, has no jitter to bracket")
    port = delay_at or writer_port(resolve(loop), at)
    bench = _Bench(loop, at, port, extra, still.phase_margin_frequency / (2 * np.pi))
    sampling = APPROXIMATE if opened.opened.samplers else "exact"
    best = JitterRuns(jitter_margin(around, rate).margin, still.delay_margin, "a constant delay", 0.0, sampling)
    shapes = SHAPES if rate == np.inf else {"a triangle": SHAPES["a triangle"]}
    for shape in shapes:
        for times in TIMES:
            best = _less(bench, best, (shape, times * bench.crossover), rate)
    return best


@final
@dataclass(frozen=True)
class _Bench:
    """What is run: the loop, the signal that is watched, where the delay varies, the delay that is there (s), and the
    crossover frequency (Hz)."""

    loop: Loop
    at: str
    port: str
    extra: float
    crossover: float


def _less(bench: _Bench, best: JitterRuns, how: tuple[str, float], rate: float) -> JitterRuns:
    """The best, or what one more shape and frequency does with less."""
    shape, often = how

    def frequency(most: float) -> float:
        return min(often, rate / (2 * most))

    def grows(most: float) -> bool:
        return _grows(bench, lambda t: SHAPES[shape](t, most, frequency(most)))

    high = NEARER * best.lost
    if high <= best.certain or not grows(high):
        return best
    low = best.certain
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return replace(best, lost=high, shape=shape, frequency=frequency(high))


def _grows(bench: _Bench, vary: Callable[[Array], Array]) -> bool:
    """Whether the linear loop, kicked once, swings more at the end of a run than before."""
    loop, _ = without_amplitude_effects(resolve(bench.loop))
    late = SignalDelay()
    varied = insert(loop, find_port(loop, bench.port), late, sources={"delay": signal_expression(VARYING)})
    kicked, kick = disturbed_at(varied, bench.at)
    fine = int(np.ceil(loop.frame * PER_PERIOD * bench.crossover))
    kicked = replace(kicked, frame=loop.frame / max(fine, 1))
    duration = PERIODS / bench.crossover
    time = np.arange(0.0, duration + 2 * kicked.frame, kicked.frame)
    stimuli = {
        VARYING: Column(time=time, values=bench.extra + vary(time)),
        kick: Pulse(amplitude=1.0, width=KICK * kicked.frame),
    }
    run = simulate(kicked, stimuli, duration=duration)
    if run.diverged is not None:
        return True
    rows = run.record[bench.at]
    third = len(rows) // 3
    before, after = (float(np.sqrt(np.mean(part**2))) for part in (rows[third : 2 * third], rows[2 * third :]))
    return after > before
