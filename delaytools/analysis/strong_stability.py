"""Neutral loops: whether arbitrarily small changes of their delays may flip a verdict."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from delaytools.analysis.structured_value import StructuredValue, structured_value
from delaytools.linear.channel import Delay
from delaytools.linear.delay_system import DelaySystem

__all__ = ["StrongStability", "strong_stability"]

RealArray = NDArray[np.float64]
_FARTHEST = 150.0  # of an exponent: what decays faster is as good as gone, and its squares are no numbers
_NOTHING = 1e-12  # of a direct gain: below it, it is rounding


@final
@dataclass(frozen=True, eq=False)
class StrongStability:
    """What the directly coupled delays of a closed system allow, w(t) = D22 [w_i(t - τ_i)], its states left out.

    gamma: γ(0) = max over θ of ρ(D22 diag(e^{jθ})). abscissa: C_D in rad/s, the smallest c to the right of which no
    chain of roots stays for some delays as near to these as wanted: γ(C_D) = 1 with D22 diag(e^{jθ_i - C_D τ_i}); -inf
    where no delay feeds itself. gap: of γ(0), how far its two bounds are apart. channels: the delays that take part.
    """

    gamma: float
    abscissa: float
    gap: float
    channels: tuple[int, ...]

    @property
    def is_strong(self) -> bool:
        """Whether stability, where there is some, survives all small changes of the delays: γ(0) < 1."""
        return self.gamma < 1.0

    @property
    def words(self) -> str:
        """What to make of it, "" where it is strong."""
        if self.is_strong:
            return ""
        return (
            f"delays feed themselves directly with γ(0) = {self.gamma:.4g}, not below 1: an arbitrarily small change "
            f"of them makes the loop unstable, whatever the verdict for these delays"
        )


def strong_stability(system: DelaySystem) -> StrongStability:
    """γ(0) and C_D of a closed system: delays free of each other, holds let nothing pass at once.

    Hale & Verduyn Lunel, IMA J. Math. Control Inf. 19 (2002) 5; Michiels & Vyhlídal, Automatica 41 (2005) 991.
    Transports of 0 s count as wires: a loop is asked about one of them by giving it a span first.
    """
    spans = np.array([c.span if isinstance(c, Delay) else 0.0 for c in system.channels])
    wires = [i for i, c in enumerate(system.channels) if isinstance(c, Delay) and c.span == 0]
    if wires:
        return strong_stability(system.without_zero_delays())
    passing = np.flatnonzero([isinstance(c, Delay) for c in system.channels])
    direct, spans = system.D22[np.ix_(passing, passing)], spans[passing]
    at_zero = structured_value(direct)
    gap = at_zero.upper - at_zero.lower
    if at_zero.upper < _NOTHING:
        return StrongStability(0.0, -np.inf, 0.0, ())
    kept = tuple(int(i) for i in passing[_on_circles(direct)])
    return StrongStability(_value(at_zero), _abscissa(direct, spans), gap, kept)


def _value(found: StructuredValue) -> float:
    return found.upper if found.upper - found.lower > 1e-9 * found.upper else found.lower


def _on_circles(direct: RealArray) -> NDArray[np.bool_]:
    """(n,) the delays whose output comes back to them without a state between."""
    reach = np.abs(direct) > 0
    for _ in range(len(direct).bit_length()):
        reach = reach | (reach.astype(int) @ reach.astype(int) > 0)
    return np.asarray(np.diag(reach))


def _abscissa(direct: RealArray, spans: RealArray) -> float:
    """The c at which γ(c) = 1; γ falls as c grows."""
    longest, shortest = float(spans.max()), float(spans[_on_circles(direct)].min())

    def excess(c: float) -> float:
        with np.errstate(over="ignore"):
            return float(np.log(_value(structured_value(direct * np.exp(-c * spans)[None, :]))))

    at_zero = excess(0.0)
    if at_zero == 0.0:
        return 0.0
    far = at_zero / (shortest if at_zero > 0 else longest)  # a circle's spans add up to no less, and no more
    low, high = min(0.0, far), max(0.0, far)
    while excess(low) < 0:
        if -low * longest > _FARTHEST:
            return -np.inf
        low *= 2
    while excess(high) > 0:
        high *= 2
    return float(brentq(excess, low, high, xtol=1e-13 * max(1.0, abs(high)), rtol=1e-14))
