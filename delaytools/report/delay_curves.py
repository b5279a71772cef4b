"""Margins against the delay at one place: configurations that differ in that delay alone share a curve."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.margins import Margins
from delaytools.analysis.questions import loop_margins
from delaytools.loop.loop import Loop
from delaytools.report.cases import Asked, Case, same_loop, without_present

__all__ = ["DelayCurve", "Family", "delay_curve", "delay_range", "families"]

POINTS = 37
Array = NDArray[np.float64]


@final
@dataclass(frozen=True)
class Family:
    """Configurations that are one loop but for the delay at the place asked: (name, present delay in s)."""

    members: tuple[tuple[str, float], ...]
    loop: Loop

    @property
    def name(self) -> str:
        """The members' names."""
        return ", ".join(name for name, _ in self.members)


@final
@dataclass(frozen=True)
class DelayCurve:
    """Margins of one family for every delay (n,) in s at the place; stable: intervals in s.

    gain_margin as a ratio, phase_margin in rad, delay_margin in s: (n,), nan where unstable or without a margin.
    """

    family: Family
    delays: Array
    gain_margin: Array
    phase_margin: Array
    delay_margin: Array
    stable: tuple[tuple[float, float], ...]
    sampling: str


def families(cases: tuple[Case, ...], asked: Asked) -> tuple[Family, ...]:
    """The cases gathered by what is left of them without the delay at the place asked."""
    found: list[Family] = []
    for case in cases:
        bare, present = without_present(case.loop, asked.delay_at)
        for index, family in enumerate(found):
            if same_loop(family.loop, bare):
                found[index] = Family((*family.members, (case.name, present)), family.loop)
                break
        else:
            found.append(Family(((case.name, present),), bare))
    return tuple(found)


def delay_range(asked: Asked, margins: list[Margins]) -> tuple[float, float]:
    """The delays asked, else from 0 to twice the largest delay margin, else to 20 ms."""
    if asked.high is not None:
        return asked.low, asked.high
    known = [m.delay_margin for m in margins if m.delay_margin]
    return 0.0, 2.0 * max(known) if known else 0.02


def delay_curve(family: Family, asked: Asked, span: tuple[float, float], points: int = POINTS) -> DelayCurve:
    """The curve of one family over `span` (s), with the members' present delays among its points."""
    low, high = span
    present = [tau for _, tau in family.members if low <= tau <= high]
    delays = np.unique(np.concatenate([np.linspace(low, high, points), present]))
    sweep = loop_margins(family.loop, asked.at, delays.tolist(), delay_at=asked.delay_at)
    columns = [
        _column(sweep.margins, get)
        for get in (lambda m: m.gain_margin, lambda m: m.phase_margin, lambda m: m.delay_margin)
    ]
    edges = [tau for pair in sweep.stable_delays for tau in pair if low < tau < high]
    apart = np.array([all(abs(tau - edge) > 1e-6 * (high - low) for edge in edges) for tau in delays])
    delays, columns = delays[apart], [column[apart] for column in columns]
    order = np.argsort(np.concatenate([delays, edges]), kind="stable")
    ends = ([1.0] * len(edges), [0.0] * len(edges), [0.0] * len(edges))
    gain, phase, delay = (
        np.concatenate([column, end])[order] for column, end in zip(columns, ends, strict=True)
    )
    delays = np.concatenate([delays, edges])[order]
    return DelayCurve(family, delays, gain, phase, delay, sweep.stable_delays, sweep.margins[0].sampling)


def _column(margins: tuple[Margins, ...], get: Callable[[Margins], float | None]) -> Array:
    return np.array([np.nan if (value := get(m)) is None else value for m in margins])
