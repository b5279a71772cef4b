"""The rightmost characteristic roots as the delay at one place grows, and where they cross the axis."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.questions import loop_roots
from delaytools.report.cases import Asked
from delaytools.report.delay_curves import DelayCurve, Family

__all__ = ["Locus", "locus"]

STEPS = 81
COUNT = 12


@final
@dataclass(frozen=True)
class Locus:
    """delays (n,) s; roots: for each delay those with Im s >= 0, rad/s; crossings: (delay s, frequency rad/s).

    present: (configuration, delay s, its rightmost root that oscillates).
    """

    name: str
    delays: NDArray[np.float64]
    roots: tuple[NDArray[np.complex128], ...]
    crossings: tuple[tuple[float, float], ...]
    present: tuple[tuple[str, float, complex], ...]
    sampling: str
    certified: bool


def locus(curve: DelayCurve, asked: Asked, span: tuple[float, float], steps: int = STEPS) -> Locus:
    """The root locus of the family of a delay curve, over `span` (s)."""
    delays = np.linspace(*span, steps)
    edges = [tau for pair in curve.stable for tau in pair if span[0] < tau < span[1]]
    present = [(name, tau) for name, tau in curve.family.members]
    every = [*delays.tolist(), *edges, *(tau for _, tau in present)]
    sets, sampling, certified = _roots(curve.family, asked, every)
    at_edges = sets[steps : steps + len(edges)]
    marked = sets[steps + len(edges) :]
    crossings = tuple(
        (tau, float(abs(roots[np.argmin(np.abs(roots.real))].imag)))
        for tau, roots in zip(edges, at_edges, strict=True)
    )
    shown = tuple(
        (name, tau, _leading(roots)) for (name, tau), roots in zip(present, marked, strict=True) if len(roots)
    )
    return Locus(curve.family.name, delays, sets[:steps], crossings, shown, sampling, certified)


def _leading(roots: NDArray[np.complex128]) -> complex:
    """The rightmost root that oscillates, else the rightmost."""
    turning = roots[np.abs(roots.imag) > 1e-6 * np.abs(roots)]
    return complex(turning[0] if len(turning) else roots[0])


def _roots(
    family: Family, asked: Asked, delays: list[float]
) -> tuple[tuple[NDArray[np.complex128], ...], str, bool]:
    answer = loop_roots(family.loop, asked.at, delays=delays, delay_at=asked.delay_at, count=COUNT)
    upper = tuple(item.roots[item.roots.imag >= 0] for item in answer.sets)
    return upper, answer.sampling, all(item.certified for item in answer.sets[:STEPS])
