"""Exact margins of a sampled loop, opened at a sampled signal: the pulse transfer L(e^{jωT}) up to π/T."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.optimize import brentq

from delaytools.analysis.crossings import PhaseCrossings
from delaytools.analysis.curve import Curve, Features, RealArray, traced
from delaytools.analysis.margin_table import MarginTable, margin_table
from delaytools.analysis.margins import Labels, Margins, margins_of_table
from delaytools.linear.lifted import LiftedSystem, lift, why_not_liftable
from delaytools.linear.sampled_system import SampledSystem
from delaytools.signals.trouble import AnalysisError

__all__ = ["SampledLoop", "pulse_crossings", "sampled_margins", "sampled_stable", "sweep_sampled_margins"]

MARGINAL = 1e-11  # a multiplier this near the unit circle is not called stable


@final
@dataclass(frozen=True, eq=False)
class SampledLoop:
    """A sampled loop cut at a sampled signal of period T (s).

    opened: input `reader` is the sequence that the readers of the signal see (new at 0, T, 2T, ...), its only
    output what the writer writes: L = -y/e. closed_at(τ): the closed loop with τ s of extra delay at the writer.
    """

    opened: SampledSystem
    reader: str
    period: float
    closed_at: Callable[[float], SampledSystem]


def sampled_margins(loop: SampledLoop, *, delay: float = 0.0, labels: Labels | None = None) -> Margins:
    """The margins of a sampled loop, exact; `delay` (s) is only what the record says is in place already.

    L(e^{jωT}) = -C (zI - Φ)⁻¹ Γ - D; stability: all eigenvalues of the closed loop's monodromy matrix inside the
    unit circle; delay margin: the smallest τ, not only multiples of T, at which one reaches it.
    Raises AnalysisError where no exact model exists (`why_not_liftable` says why beforehand).
    """
    table = margin_table(_pulse_curve(loop), np.zeros(1))
    stable = sampled_stable(loop.closed_at(0.0))
    margin = _delay_margin(loop, table) if stable else np.inf
    table = replace(table, delays=np.array([delay]), delay_margin=np.array([margin]))
    labels = Labels("exact", labels.linearised_without if labels else ())
    return margins_of_table(table, [stable], labels)[0]


def sweep_sampled_margins(
    loop_at: Callable[[float], SampledLoop], delays: Sequence[float], labels: Labels | None = None
) -> tuple[tuple[Margins, ...], tuple[tuple[float, float], ...]]:
    """(margins, stable intervals in s) over an extra delay anywhere: loop_at(τ) has τ s in place.

    The ends of the intervals are refined where stability changes between two neighbouring delays; a window
    narrower than the spacing of the sweep, or than a quarter of a period, can be missed.
    """
    found = tuple(sampled_margins(loop_at(float(tau)), delay=float(tau), labels=labels) for tau in delays)

    def excess(tau: float) -> float:
        return _radius(loop_at(tau).closed_at(0.0)) - 1.0

    grid = _between([float(tau) for tau in delays], loop_at(float(delays[0])).period / 4)
    values = [excess(tau) for tau in grid]
    intervals, start = [], grid[0] if values[0] < 0 else None
    for i in range(1, len(grid)):
        if (values[i - 1] < 0) == (values[i] < 0):
            continue
        edge = float(brentq(excess, grid[i - 1], grid[i], xtol=1e-15, rtol=1e-13))
        if start is not None:
            intervals.append((start, edge))
        start = edge if values[i] < 0 else None
    if start is not None:
        intervals.append((start, grid[-1]))
    return found, tuple(intervals)


def pulse_crossings(loop: SampledLoop) -> PhaseCrossings:
    """Where the pulse transfer is real and negative, the ends at 0 and π/T included: there a factor of 1/gain brings a
    root to the unit circle."""
    return margin_table(_pulse_curve(loop), np.zeros(1)).listed


def sampled_stable(closed: SampledSystem) -> bool:
    """Whether every root of the closed sampled loop decays: spectral radius of the monodromy below 1."""
    return _radius(closed) < 1.0 - MARGINAL


def _between(delays: list[float], step: float) -> list[float]:
    """The delays, rising, with points between them no further apart than `step` (1000 more at most)."""
    delays = sorted(set(delays))
    step = max(step, (delays[-1] - delays[0]) / 1000)
    parts = [
        np.linspace(a, b, max(2, int(np.ceil((b - a) / step)) + 1))[:-1].tolist() for a, b in pairwise(delays)
    ]
    return [tau for part in parts for tau in part] + [delays[-1]]


def _lifted(system: SampledSystem, held: dict[str, float] | None = None) -> LiftedSystem:
    found = lift(system, held)
    if found is None:
        raise AnalysisError(
            "this sampled loop has no exact discrete model", found=why_not_liftable(system, held)
        )
    return found


def _radius(system: SampledSystem) -> float:
    return _lifted(system).spectral_radius


def _pulse_curve(loop: SampledLoop) -> Curve:
    """-L of the opened loop's pulse transfer, traced up to π/T."""
    lifted = _lifted(loop.opened, {loop.reader: loop.period})
    if not lifted.input_matrix.size or abs(lifted.period - loop.period) > 1e-9 * loop.period:
        raise AnalysisError(
            "a loop of several rates has no pulse transfer at a signal faster than its hyper-period",
            found=f"period {loop.period} s, hyper-period {lifted.period} s",
            advice="use the continuous approximation there",
        )

    def response(omega: RealArray) -> NDArray[np.complex128]:
        return -lifted.pulse(omega)[:, 0, 0]

    return traced(response, _pulse_features(lifted), top=np.pi / loop.period)


def _pulse_features(lifted: LiftedSystem) -> Features:
    """Poles and zeros z of the pulse transfer as s = log(z)/T; L(1) as the value at ω = 0."""
    n = len(lifted.monodromy)
    pencil = np.block([[lifted.monodromy, lifted.input_matrix], [lifted.output_matrix, lifted.feedthrough]])
    mass = np.zeros_like(pencil)
    mass[:n, :n] = np.eye(n)
    with np.errstate(all="ignore"):
        z = np.concatenate([lifted.multipliers, eigvals(pencil, mass)])
        z = z[np.isfinite(z) & (np.abs(z) > 1e-6) & (np.abs(z) < 1e6)]
    points = np.log(z.astype(complex)) / lifted.period
    at_one = np.abs(lifted.multipliers - 1).min(initial=np.inf) < 1e-9
    at_zero = np.nan if at_one else -float(lifted.pulse(np.zeros(1))[0, 0, 0].real)
    return Features(points, (), at_zero, np.nan, np.nan)


def _delay_margin(loop: SampledLoop, table: MarginTable) -> float:
    """The smallest extra delay at which the spectral radius reaches 1: marched in steps, then refined.

    A whole period of delay is a factor 1/z, which leaves |L| as it is: where |L| = 1 at ω, stability is lost
    within 2π/ω and one period; where |L| stays below 1 for every part of a period, never.
    """
    omega = table.gains.omega
    guess = float(table.delay_margin[0])
    if not omega.size:
        limit, step = 2.0 * loop.period, loop.period / 8
    else:
        limit = 2 * np.pi / float(omega.min()) + 2 * loop.period
        step = min(loop.period / 2, max(guess, 1e-3 * loop.period) / 4)

    def excess(tau: float) -> float:
        return _radius(loop.closed_at(tau)) - 1.0

    before = 0.0
    while before < limit:
        after = before + step
        if excess(after) >= 0:
            return float(brentq(excess, before, after, xtol=1e-15, rtol=1e-13))
        before, step = after, min(loop.period / 2, 2 * step)
    return np.inf
