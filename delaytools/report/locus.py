"""The rightmost characteristic roots as the delay at one place grows, and where they cross the axis."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.loop_loci import loop_loci
from delaytools.analysis.questions import loop_roots
from delaytools.analysis.root_loci import AxisCrossing, Branch
from delaytools.report.cases import Asked
from delaytools.report.delay_curves import DelayCurve

__all__ = ["Locus", "locus"]

COUNT = 12


@final
@dataclass(frozen=True)
class Locus:
    """span: (first, last) delay in s; branches, crossings: of the loci over it, as `RootLoci` has them.

    present: (configuration, delay s, its rightmost root that oscillates).
    """

    name: str
    span: tuple[float, float]
    branches: tuple[Branch, ...]
    crossings: tuple[AxisCrossing, ...]
    present: tuple[tuple[str, float, complex], ...]
    sampling: str
    certified: bool


def locus(curve: DelayCurve, asked: Asked, span: tuple[float, float]) -> Locus:
    """The root locus of the family of a delay curve, over `span` (s)."""
    found = loop_loci(curve.family.loop, asked.at, delays=span, delay_at=asked.delay_at, count=COUNT)
    members = list(curve.family.members)
    delays = [tau for _, tau in members]
    marked = loop_roots(curve.family.loop, asked.at, delays=delays, delay_at=asked.delay_at, count=COUNT).sets
    shown = tuple(
        (name, tau, _leading(one.roots))
        for (name, tau), one in zip(members, marked, strict=True) if len(one.roots)
    )  # fmt: skip
    return Locus(curve.family.name, span, found.branches, found.crossings, shown, found.sampling, found.certified)


def _leading(roots: NDArray[np.complex128]) -> complex:
    """The rightmost root that oscillates, else the rightmost."""
    turning = roots[np.abs(roots.imag) > 1e-6 * np.abs(roots)]
    return complex(turning[0] if len(turning) else roots[0])
