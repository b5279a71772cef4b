"""Run a loop in time: the verb, and the figures that say what each signal did."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.loop.loop import Loop
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column, Stimulus
from delaytools.signals.trouble import AnalysisError
from delaytools.simulation.compiling import compile_loop
from delaytools.simulation.run import run

__all__ = ["SignalFigures", "Simulation", "oscillation", "signal_figures", "simulate", "strongest_line"]


@final
@dataclass(frozen=True)
class SignalFigures:
    """rms, peak and oscillation_amplitude in the signal's unit, oscillation_frequency in Hz (last half of the run)."""

    rms: float
    peak: float
    oscillation_amplitude: float
    oscillation_frequency: float


@final
@dataclass(frozen=True)
class Simulation:
    """A run: its record, and how long it took.

    diverged: time (s) from which a value was no longer finite and rows were left out, or None.
    real_time_factor: simulated seconds per second of computing, compilation included.
    """

    record: Record
    seconds_simulated: float
    real_time_factor: float
    diverged: float | None

    @cached_property
    def figures(self) -> Mapping[str, SignalFigures]:
        """Figures of every signal."""
        return signal_figures(self.record)


def simulate(
    loop: Loop,
    stimuli: Mapping[str, Stimulus] | None = None,
    *,
    duration: float,
    seed: int = 1,
    substeps: int | None = None,
) -> Simulation:
    """The loop run for `duration` s, driven by `stimuli` (missing inputs are 0).

    Rows at the loop's frame. Classical Runge–Kutta steps, split where jumps arrive; delays through cubic Hermite
    pieces of history, so the order is 4 also across held and delayed held signals. `substeps`: steps per frame
    (default: from the fastest eigenvalue).
    """
    if not duration >= loop.frame:
        raise AnalysisError(
            "a run lasts at least one frame", found=f"{duration:g} s", advice=f"frame {loop.frame:g} s"
        )
    begin = time.perf_counter()
    driven = {**(stimuli or {}), **_draws(loop, duration, seed)}
    compiled = compile_loop(loop, driven, duration=duration, substeps=substeps)
    t, table = run(compiled)
    elapsed = time.perf_counter() - begin
    good = np.isfinite(table).all(axis=1) & (np.abs(table).max(axis=1, initial=0.0) < 1e200)
    diverged = None if good.all() else float(t[np.argmin(good)])
    count = len(t) if good.all() else int(np.argmin(good))
    names = compiled.model.layout.signals
    units = {name: loop.units[name] for name in names if name in loop.units}
    columns = {name: table[:count, i] for i, name in enumerate(names)}
    record = Record(
        t[:count], columns, units, compiled.model.net.held_signals & frozenset(names), "simulation"
    )
    return Simulation(record, float(t[count - 1]), duration / elapsed, diverged)


def _draws(loop: Loop, duration: float, seed: int) -> dict[str, Stimulus]:
    """Random numbers for the signals that the loop draws, one per frame, reproducible by seed."""
    frames = round(duration / loop.frame) + 2
    found: dict[str, Stimulus] = {}
    for number, name in enumerate(sorted(loop.random)):
        drawn = np.random.default_rng([seed, number]).uniform(size=frames)
        found[name] = Column(time=loop.frame * np.arange(frames), values=drawn, held=False)
    return found


def signal_figures(record: Record) -> dict[str, SignalFigures]:
    """Figures of every signal of a record."""
    found = {}
    for name in record.names:
        values = record[name]
        amplitude, frequency = oscillation(record.time, values)
        rms, peak = float(np.sqrt(np.mean(values**2))), float(np.max(np.abs(values)))
        found[name] = SignalFigures(rms, peak, amplitude, frequency)
    return found


def oscillation(time: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, float]:
    """`strongest_line` of the last half of a run."""
    half = time >= (time[0] + time[-1]) / 2
    return strongest_line(time[half], values[half])


def strongest_line(t: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, float]:
    """Amplitude and frequency (Hz) of the strongest line in a signal; (0, NaN) where there is none.

    The line is the largest peak of the Hann-windowed spectrum above one cycle per window, placed between bins by
    a parabola through the logarithms; its amplitude is the least-squares sine at that frequency.
    """
    n, y = len(t), values - np.mean(values)
    if n < 16 or np.ptp(y) <= 1e-9 * (1e-300 + np.max(np.abs(values))):
        return 0.0, float("nan")
    step = (t[-1] - t[0]) / (n - 1)
    line = np.polynomial.Polynomial.fit(t, y, 1)
    y = y - line(t)
    spectrum = np.abs(np.fft.rfft(y * np.hanning(n), 4 * n))
    first = 6  # 1.5 cycles per window, below which a trend hides
    best = first + int(np.argmax(spectrum[first:-1]))
    a, b, c = np.log(spectrum[best - 1 : best + 2] + 1e-300)
    shift = 0.5 * (a - c) / (a - 2 * b + c) if a - 2 * b + c < 0 else 0.0
    frequency = (best + np.clip(shift, -0.5, 0.5)) / (4 * n * step)
    basis = np.stack(
        [np.sin(2 * np.pi * frequency * t), np.cos(2 * np.pi * frequency * t), np.ones(n)], axis=1
    )
    sine = np.linalg.lstsq(basis, y, rcond=None)[0]
    return float(np.hypot(sine[0], sine[1])), float(frequency)
