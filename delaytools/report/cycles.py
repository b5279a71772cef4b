"""Limit cycles of one family against the delay at one place, and of its configurations as they stand."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.limit_cycles import LimitCycle, LimitCycles, limit_cycles
from delaytools.report.cases import Asked
from delaytools.report.delay_curves import DelayCurve, Family

__all__ = ["CycleCurve", "CycleLine", "cycle_curve", "kind_of"]

POINTS = 25
NEAR = np.array([0.25, 3.0])  # in the logarithms of frequency and amplitude: the same cycle one delay further


@final
@dataclass(frozen=True)
class CycleLine:
    """One cycle over delays (n,) in s: amplitudes in the signal's unit, frequencies in Hz, whether it lasts."""

    delays: NDArray[np.float64]
    amplitudes: NDArray[np.float64]
    frequencies: NDArray[np.float64]
    lasts: bool


@final
@dataclass(frozen=True)
class CycleCurve:
    """lines: predicted over the delays, of cycles that last or part.

    present: (configuration, its delay in s, its cycles, checked by simulation). lost: the delays, in s, at which the
    loop without what depends on amplitude becomes unstable.
    """

    family: Family
    nonlinear: tuple[str, ...]
    lines: tuple[CycleLine, ...]
    present: tuple[tuple[str, float, LimitCycles], ...]
    lost: tuple[float, ...]


def cycle_curve(curve: DelayCurve, asked: Asked, span: tuple[float, float]) -> CycleCurve:
    """The limit cycles of the family of a delay curve, over `span` (s)."""
    loop = curve.family.loop
    present = tuple(
        (name, tau, limit_cycles(loop, asked.at, [tau], delay_at=asked.delay_at))
        for name, tau in curve.family.members
    )
    nonlinear = present[0][2].nonlinear
    lines: tuple[CycleLine, ...] = ()
    if nonlinear:
        delays = np.unique([*np.linspace(*span, POINTS), *(tau for _, tau, _ in present)]).tolist()
        found = limit_cycles(loop, asked.at, delays, delay_at=asked.delay_at, check=False)
        lines = tuple(_lines([one for one in found.cycles if kind_of(one) != "neither"], delays))
    lost = tuple(high for _, high in curve.stable if high < span[1])
    return CycleCurve(curve.family, nonlinear, lines, present, lost)


def kind_of(one: LimitCycle) -> str:
    """ "lasts"; "parts": what is smaller dies out, what is larger grows; "neither": left by another motion."""
    if one.stable:
        return "lasts"
    return "parts" if one.growth > 0 else "neither"


def _lines(cycles: Sequence[LimitCycle], delays: Sequence[float]) -> Iterator[CycleLine]:
    """Cycles of neighbouring delays joined to the nearest in frequency and amplitude."""
    chains: list[list[LimitCycle]] = []
    for before, tau in itertools.pairwise([np.nan, *delays]):
        for one in (one for one in cycles if one.delay == tau):
            near = [chain for chain in chains if chain[-1].delay == before and _apart(chain[-1], one) < 1]
            if near:
                min(near, key=lambda chain, one=one: _apart(chain[-1], one)).append(one)  # type: ignore[misc]
            else:
                chains.append([one])
    for chain in chains:
        rows = np.array([(one.delay, one.amplitude, one.frequency) for one in chain])
        yield CycleLine(rows[:, 0], rows[:, 1], rows[:, 2], chain[0].stable)


def _apart(one: LimitCycle, other: LimitCycle) -> float:
    """Below 1 where two cycles can be the same one, a delay apart."""
    if one.stable != other.stable:
        return np.inf
    steps = np.log([other.frequency / one.frequency, other.amplitude / one.amplitude])
    return float(np.max(np.abs(steps) / NEAR))
