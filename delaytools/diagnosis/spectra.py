"""Candidates found in the spectrum of the residual: interference, and a mode that another signal shakes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from delaytools.blocks.block import Sampled
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.places import Spot
from delaytools.diagnosis.screen import STRETCH, Base, Screened, response
from delaytools.diagnosis.views import View
from delaytools.loop.port import Port
from delaytools.loop.values import resolve
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Stimulus

__all__ = ["highest_lines", "impulse", "interferences", "modes"]

Array = NDArray[np.float64]
PROBE = "probe@impulse"
DAMPINGS = (0.008, 0.025, 0.08, 0.2)
WIDELY = 4.0  # times its frequency in the screen: as far as a mode's fit may go, and not beyond what rows show
LIGHTEST, LIGHT = 1e-4, 0.4  # dampings that a fit may try; above the second a mode is none
RATIO = 1.02  # of neighbouring frequencies of the search for modes
LINES = 3  # highest lines tried at a port
MODES = 3  # modes tried per port and source
NEAR_TOP, EVALUATIONS = 0.3, 30  # of the best mode's χ²: ways whose best is sought between the grid's points as well
_CHUNK = 64


def impulse(base: Base, port: Port, log: int = 0) -> Array | None:
    """(n, exits): response to a straight-line pulse of height 1 at row 0 of a log, put in at a port.

    Convolved with any column that begins at 0 and is joined by straight lines it gives the response to that column,
    where the segment is linear and rows are even. Behind a sampled block it is the mean over the rows of a period:
    what the block makes of slow columns.
    """
    case, added = base.case, base.fitted.added
    probe = Added("cross_coupling", str(port), {"gain": 1.0}, {"source": PROBE})
    replay = case.replays((*added, probe))[log]
    if replay.begins:
        replay = replace(replay, begins=(), _compiled={}, _parts={})
    known = {p.path: p.value for p in base.fitted.parameters}
    values = tuple(known.get(path, 1.0) for path in replay.free)
    rest = replay.run_driven(values, _pulse(base, log, 0)) if case.pieces else base.outputs[log]
    parts = []
    for row in range(1, _rows_of_a_period(case) + 1):
        change = replay.run_driven(values, _pulse(base, log, row)) - rest
        parts.append(np.concatenate([change[row:], np.zeros((row, change.shape[1]))]))
    found = np.mean(parts, axis=0)
    return found if np.isfinite(found).all() else None


def _pulse(base: Base, log: int, row: int) -> Mapping[str, Stimulus]:
    """A pulse at a row of a log; none at row 0."""
    record = base.case.records[log]
    height = np.zeros(len(record))
    height[row] = float(row > 0)
    carried = Record(record.time, {**record.columns, PROBE: height}, record.units, record.held)
    return base.case.stimuli_for(carried, (PROBE,))


def _rows_of_a_period(case: Case) -> int:
    """Rows in the longest period of the segment's sampled blocks, 1 where there is none."""
    elements = resolve(case.segment.loop).elements
    periods = [float(e.block.period) for e in elements if isinstance(e.block, Sampled)]
    return max(1, round(max(periods, default=0.0) / case.step))


def _whitened_spectra(base: Base, log: int, size: int) -> tuple[Array, Array]:
    """(exits, bins): spectra of the whitened residual of one log, and of the filters."""
    rows = base.case.rows
    count = len(base.case.exits)
    parts = [base.residual[(rows.log == log) & (rows.exit == j)] for j in range(count)]
    filters = [np.fft.rfft(base.case.whitening[j].taps, size) for j in range(count)]
    return np.stack([np.fft.rfft(part, size) for part in parts]), np.stack(filters)


def interferences(base: Base, spots: Sequence[Spot]) -> list[Screened]:
    """The highest lines of the whitened residual, as interference where it leaves a block of the segment.

    None with less than a period in every stretch of rows that count: beside states that begin anew with each piece of
    a real run, a slower wave is a curve that any force which is not modelled draws as well.
    """
    found = []
    case = base.case
    least = _slowest(case)
    size = 4 * len(case.records[0])
    spectra, filters = _whitened_spectra(base, 0, size)
    frequency = np.fft.rfftfreq(size, case.step)
    for spot in (s for s in spots if s.kind == "periodic_interference"):
        index = case.exit_at(str(spot.port))
        if index is None:
            continue
        power = np.abs(spectra[index]) ** 2 * 2 / len(case.records[0])
        power[frequency < least] = 0.0
        for peak in highest_lines(power, LINES, apart=2 * size // len(case.records[0])):
            line = spectra[index][peak] / filters[index][peak] * 2 / len(case.records[0])
            values = {
                "amplitude": max(float(np.abs(line)), 1e-300),
                "frequency": float(frequency[peak]),
                "phase": float(np.angle(line * 1j)),
            }
            near, width = float(frequency[peak]), 3 / case.duration
            limits = {"phase": (-10.0, 10.0), "frequency": (max(near - width, 0.1 * least), near + width)}
            one = Added(spot.kind, str(spot.port), values, {}, frozenset(), limits)
            change = response(base, one)
            gain = 0.0 if change is None else base.gain(change, 0.4, 2.5)[0]
            found.append(Screened(one, max(gain, 0.8 * float(power[peak]))))
    return found


def _slowest(case: Case) -> float:
    """Hz: of a wave that shows a whole period in the longest stretch of rows without a new beginning."""
    lengths = [last - first for own in case.pieces for first, last in own]
    return 1 / (max(lengths, default=len(case.records[0])) * case.step)


def highest_lines(power: Array, count: int, *, apart: int) -> list[int]:
    """Where a spectrum is highest: the places of its `count` highest lines, none within `apart` of a higher one."""
    left = power.copy()
    found = []
    for _ in range(count):
        best = int(np.argmax(left))
        if left[best] <= 0:
            break
        found.append(best)
        left[max(best - apart, 0) : best + apart + 1] = 0.0
    return found


def modes(base: Base, view: View, spots: Sequence[Spot]) -> list[Screened]:
    """Modes at the ports of the segment, by source: a dense grid of frequencies and dampings, in the spectrum."""
    case = base.case
    size = 2 * len(case.records[0])
    spectra, filters = _whitened_spectra(base, 0, size)
    ways: list[_Shaken] = []
    for port in dict.fromkeys(s.port for s in spots if s.kind == "flexible_mode"):
        pulse = impulse(base, port)
        if pulse is None:
            continue
        through = np.fft.rfft(pulse, size, axis=0).T * filters
        for source in view.sources:
            shaken = view.signals[0][source]
            if view.is_at(port, source) and port.kind == "output":
                continue
            at_first = shaken[0] if case.pieces else 0.0  # a run begins at rest: its first row is a jump
            ways.append(_Shaken(port, source, through * np.fft.rfft(shaken - at_first, size)))
    if not ways:
        return []
    products = np.stack([np.sum(spectra.conj() * way.driven, axis=0) for way in ways], 1)
    powers = np.stack([np.sum(np.abs(way.driven) ** 2, axis=0) for way in ways], 1)
    tops = _best_modes(products, powers, (size, case.step))
    least = NEAR_TOP * max(first.chi2 for first, *_ in tops)
    found = []
    for way, (first, *others) in zip(ways, tops, strict=True):
        nearer = _between_the_grid(base, way, first) if first.chi2 > least else first
        found += [_candidate(case, way, mode) for mode in (nearer, *others)]
    return [_exactly(base, one) if one.gain > least else one for one in found]


@final
@dataclass(frozen=True, eq=False)
class _Shaken:
    """A signal that may shake a mode at a port; driven: (exits, bins) its whitened spectra there, the mode left out."""

    port: Port
    source: str
    driven: NDArray[np.complex128]


@final
@dataclass(frozen=True, order=True)
class _Mode:
    """A mode with the χ² that it takes off; frequency in Hz."""

    chi2: float
    frequency: float
    damping: float
    gain: float


def _candidate(case: Case, way: _Shaken, mode: _Mode) -> Screened:
    centre = mode.frequency
    values = {"gain": mode.gain, "frequency": centre, "damping": mode.damping}
    highest = max(centre, min(WIDELY * centre, 0.5 / case.step))
    limits = {"damping": (LIGHTEST, LIGHT), "frequency": (centre / WIDELY, highest)}
    one = Added("flexible_mode", str(way.port), values, {"source": way.source}, frozenset(), limits)
    return Screened(one, mode.chi2)


def _exactly(base: Base, found: Screened) -> Screened:
    """With what a run says: between rows a staircase is none of the waves that its samples could be."""
    change = response(base, found.added)
    return Screened(found.added, 0.0 if change is None else base.gain(change, *STRETCH)[0])


def _best_modes(products: Array, powers: Array, sampling: tuple[int, float]) -> list[list[_Mode]]:
    """The best modes of the grid for every way, the best first; products, powers: (bins, ways)."""
    size, step = sampling
    count = size // 2
    frequency = np.fft.rfftfreq(size, step)
    centres = np.exp(np.arange(math.log(4 / (count * step)), math.log(0.45 / step), math.log(RATIO)))
    best: list[list[_Mode]] = [[] for _ in range(products.shape[1])]
    for damping in DAMPINGS:
        for first in range(0, len(centres), _CHUNK):
            chosen = centres[first : first + _CHUNK]
            shape = _shape(frequency, chosen, damping)
            up = (shape @ products.astype(np.complex64)).real
            down = (np.abs(shape) ** 2) @ powers.astype(np.float32)
            power = np.where(down > 0, down, np.inf)
            chi2 = 2 * up**2 / power / size
            for k, top in enumerate(np.argmax(chi2, axis=0)):
                gain = float(up[top, k] / power[top, k])
                best[k].append(_Mode(float(chi2[top, k]), float(chosen[top]), damping, gain))
    return [sorted(one, reverse=True)[:MODES] for one in best]


def _between_the_grid(base: Base, way: _Shaken, mode: _Mode) -> _Mode:
    """The best mode about that of the grid: a light one stands between its points, and the free values and uncertain
    values of other segments may imitate most of the slow part of its answer."""
    case = base.case
    rows, count = len(base.residual), len(case.records[0])
    frequency = np.fft.rfftfreq(2 * count, case.step)

    def of(logs: Array) -> tuple[float, float]:
        if not LIGHTEST < np.exp(logs[1]) < LIGHT:
            return 0.0, 0.0
        shape = _shape(frequency, np.exp(logs[:1]), float(np.exp(logs[1])))
        answer = np.fft.irfft(shape * way.driven, 2 * count)[:, :count]
        whole = np.zeros(rows)
        whole[case.rows.log == 0] = answer.ravel()
        return base.gain(case.less_nuisance(whole))

    start = np.log([mode.frequency, mode.damping])
    corners = start + np.array([[0.0, 0.0], [math.log(RATIO), 0.0], [0.0, -1.0]])
    options = {"maxfev": EVALUATIONS, "initial_simplex": corners}
    logs = minimize(lambda x: -of(x)[0], start, method="Nelder-Mead", options=options).x
    chi2, gain = of(logs)
    return _Mode(chi2, float(np.exp(logs[0])), float(np.exp(logs[1])), gain)


def _shape(frequency: Array, centres: Array, damping: float) -> Array:
    """ω₀ s/(s² + 2ζω₀ s + ω₀²) at s = j2πf, for every centre and frequency."""
    ratio = (frequency[None, :] / centres[:, None]).astype(np.float32)
    return (1j * ratio / (1 - ratio**2 + 2j * np.float32(damping) * ratio)).astype(np.complex64)
