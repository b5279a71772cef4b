"""The root loci of a loop: against an extra delay, or a factor on the opened signal."""

from dataclasses import replace

import numpy as np

from delaytools.analysis.opened_loop import OpenedLoop, open_loop, scaled_transport
from delaytools.analysis.questions import APPROXIMATE
from delaytools.analysis.root_families import ContinuousFamily, SampledFamily
from delaytools.analysis.root_loci import RootLoci, root_loci
from delaytools.linear.algebra import feedback
from delaytools.linear.hold_approximation import continuous_approximation
from delaytools.linear.lifted import LiftedSystem, lift, why_not_liftable
from delaytools.linear.sampled_system import SampledSystem
from delaytools.loop.loop import Loop
from delaytools.signals.trouble import AnalysisError

__all__ = ["loop_loci"]

COUNTS = 9  # values at which roots are counted


def loop_loci(
    loop: Loop,
    at: str,
    *,
    delays: tuple[float, float] | None = None,
    gains: tuple[float, float] | None = None,
    delay_at: str | None = None,
    right_of: float | None = None,
    count: int = 10,
) -> RootLoci:
    """The loci of the closed loop's characteristic roots, for an extra delay (s) or a factor on the signal `at`.

    delays, gains: the range, one of the two. right_of: rad/s; by default left of the rightmost `count` roots, a line
    that moves with the parameter. Without sampled blocks: of the exact delay system. Sampled loops: s = ln(z)/T of
    the exact monodromy; where there is none, the continuous approximation. Raises AnalysisError for a range that does
    not rise, and where both or none are given.
    """
    if (delays is None) == (gains is None):
        given = f"delays {delays}, gains {gains}"
        raise AnalysisError("one parameter at a time", found=given, advice="give one of them")
    name, span = ("delay", delays) if delays is not None else ("gain", gains)
    assert span is not None
    if not (np.isfinite(span).all() and span[0] < span[1] and (name == "gain" or span[0] >= 0)):
        raise AnalysisError("a range rises, and a delay is not negative", found=f"{name} from {span[0]} to {span[1]}")
    opened = open_loop(loop, at, delay_at)
    family, exact = _family(opened, name, span[1])
    values = np.linspace(*span, COUNTS).tolist()
    lines = [family.line(value, count) for value in values] if right_of is None else right_of
    found = root_loci(family, values, right_of=lines, parameter=name)
    return replace(found, sampling="exact" if exact else APPROXIMATE, linearised_without=opened.without)


def _family(opened: OpenedLoop, name: str, value: float) -> tuple[ContinuousFamily | SampledFamily, bool]:
    """The closed loop against the parameter, and whether its roots are exact; value: one that it takes."""
    closed = opened.closed_at(0.0)

    def system(value: float) -> SampledSystem:
        return scaled_transport(closed, opened.closing, value) if name == "gain" else opened.closed_at(value)

    exact = not opened.opened.samplers or not why_not_liftable(system(value))
    if opened.opened.samplers and exact:
        return SampledFamily(lambda value: _lifted(system(value)), _lifted(system(value)).period), True
    if name == "gain":
        L = opened.transfer(0.0)
        return ContinuousFamily(lambda value: feedback(L * value)), exact
    return ContinuousFamily(lambda value: continuous_approximation(system(value))), exact


def _lifted(system: SampledSystem) -> LiftedSystem:
    lifted = lift(system)
    assert lifted is not None
    return lifted
