"""Margins over a sweep of extra delay, and the exact intervals of delay in which the loop is stable."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from delaytools.analysis.crossings import GainCrossings, gain_crossings
from delaytools.analysis.curve import Curve, RealArray
from delaytools.analysis.margin_table import MarginTable, margin_table
from delaytools.analysis.margins import Labels, Margins, curve_of, labels_of, margins, margins_of_table
from delaytools.analysis.stability import MARGINAL, closed_loop_of, is_stable, roots_not_left
from delaytools.linear.algebra import delay
from delaytools.linear.delay_system import DelaySystem
from delaytools.signals.trouble import AnalysisError

__all__ = [
    "DelaySweep",
    "DelayWindows",
    "delay_windows",
    "opened_at_channel",
    "sweep_channel",
    "sweep_margins",
]

Interval = tuple[float, float]


@final
@dataclass(frozen=True, eq=False)
class DelayWindows:
    """Where roots cross the axis as a series delay grows: at `delays` (s, rising) the count of roots in
    Re s > 0 changes by `change`; before the first it is `first`. Past `limit` (s) nothing was looked at.
    """

    delays: RealArray
    change: NDArray[np.int_]
    first: int
    limit: float

    def unstable_counts(self, delays: RealArray) -> NDArray[np.int_]:
        """The number of roots in Re s > 0 at each delay, outside the crossings themselves."""
        total = np.concatenate([[0], np.cumsum(self.change)])
        return self.first + total[np.searchsorted(self.delays, delays, side="left")]

    def intervals(self, low: float, high: float) -> tuple[Interval, ...]:
        """The parts of [low, high] in which the loop is stable; inner end points are exact."""
        inside = self.delays[(self.delays > low) & (self.delays < high) & (self.change != 0)]
        ends = np.unique(np.concatenate([[low], inside, [high]]))
        if len(ends) == 1:
            return ((low, high),) if self.unstable_counts(ends)[0] == 0 else ()
        stable = self.unstable_counts(0.5 * (ends[:-1] + ends[1:])) == 0
        stable &= np.diff(ends) > 1e-12 * (high - low)  # a crossing at the very end, but for rounding
        return tuple(
            (float(a), float(b)) for (a, b), good in zip(pairwise(ends), stable, strict=True) if good
        )


@final
@dataclass(frozen=True, eq=False)
class DelaySweep:
    """Margins for each delay of a sweep, and `stable_delays`: intervals (s) inside it.

    stable (n,): by count, not from the margins.
    """

    stable: tuple[bool, ...]
    stable_delays: tuple[Interval, ...]
    table: MarginTable
    labels: Labels

    @cached_property
    def margins(self) -> tuple[Margins, ...]:
        """One record for each delay, in the order given."""
        return margins_of_table(self.table, self.stable, self.labels)


def sweep_margins(L: DelaySystem, delays: ArrayLike, labels: Labels | None = None) -> DelaySweep:
    """Margins of L(s) e^{-sτ} for each extra delay τ of `delays` (s, >= 0), in series with the opened signal.

    The gain crossings are found once; the phase crossings of all delays are level sets of one curve; the
    number of unstable roots is counted once and followed by the direction of each crossing.
    Raises AnalysisError where a delay is negative, or L is not single-input single-output.
    """
    wanted = _checked(delays)
    curve = curve_of(L, wanted)
    table = margin_table(curve, wanted)
    stable, intervals = _stability(L, curve, table)
    return DelaySweep(tuple(stable.tolist()), intervals, table, labels_of(L, labels))


def sweep_channel(
    L: DelaySystem, channel: int, delays: ArrayLike, labels: Labels | None = None
) -> tuple[tuple[Margins, ...], tuple[Interval, ...]]:
    """Margins of L for each span of its transport `channel` (an extra delay anywhere in the loop).

    Stability does not depend on where the loop is opened: its intervals are those of the loop opened at the
    transport itself, where the delay is in series. Gives (margins, stable intervals).
    """
    wanted = _checked(delays)
    around = opened_at_channel(closed_loop_of(L), channel)
    curve = curve_of(around, wanted)
    table = margin_table(curve, wanted)
    _, intervals = _stability(around, curve, table)
    found = []
    for span in wanted.tolist():
        spans = [span if i == channel else own for i, own in enumerate(L.delays)]
        found.append(replace(margins(L.with_spans(spans).without_zero_delays(), labels), delay=span))
    return tuple(found), intervals


def opened_at_channel(closed: DelaySystem, channel: int) -> DelaySystem:
    """The loop opened at one transport: L = -z/w with all other channels closed, one input, one output."""
    kept = [i for i in range(closed.n_channels) if i != channel]
    if not 0 <= channel < closed.n_channels:
        raise AnalysisError("no such channel", found=str(channel), known=map(str, range(closed.n_channels)))
    at = [channel]
    return DelaySystem(
        A=closed.A, B1=closed.B2[:, at], B2=closed.B2[:, kept], C1=-closed.C2[at], C2=closed.C2[kept],
        D11=-closed.D22[np.ix_(at, at)], D12=-closed.D22[np.ix_(at, kept)],
        D21=closed.D22[np.ix_(kept, at)], D22=closed.D22[np.ix_(kept, kept)],
        channels=tuple(closed.channels[i] for i in kept),
    )  # fmt: skip


def delay_windows(L: DelaySystem, limit: float, *, crossings: GainCrossings | None = None) -> DelayWindows:
    """All delays up to `limit` (s) at which roots of 1 + L(s) e^{-sτ} cross the axis.

    At a gain crossing ω the roots ±jω are reached at τ = (π + arg L + 2πm)/ω; with growing delay they go to
    the right where |L| falls with frequency, to the left where it rises (Walton & Marshall, IEE Proc. D 134
    (1987) 101). The count is certified once, between the two crossings that lie furthest apart.
    """
    crossings = gain_crossings(curve_of(L)) if crossings is None else crossings
    omega = crossings.omega
    angle = np.mod(np.angle(-crossings.value), 2 * np.pi)
    first = np.where(angle > 2 * np.pi - 1e-9, 0.0, angle) / omega  # rounding must not hide a crossing at 0
    repeats = np.maximum(0, np.floor((limit - first) * omega / (2 * np.pi)).astype(int) + 1)
    turn = np.arange(repeats.sum()) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    at = np.repeat(first, repeats) + 2 * np.pi * turn / np.repeat(omega, repeats)
    order = np.argsort(at, kind="stable")
    at, change = at[order], 2 * np.repeat(crossings.falling, repeats)[order]
    after, at_delay = _where_to_count(at, limit)
    count = roots_not_left(closed_loop_of(delay(at_delay) * L if at_delay > 0 else L))
    return DelayWindows(at, change, count - int(change[:after].sum()), limit)


def _where_to_count(at: RealArray, limit: float) -> tuple[int, float]:
    """(crossings before it, delay): no delay at all where the first crossing is not near, else far from all."""
    ends = np.concatenate([[0.0], at, [limit]])[:9]
    widths = np.diff(ends)
    widest = int(np.argmax(widths))
    if widths[0] > 0.01 * widths[widest]:
        return 0, 0.0
    return widest, 0.5 * float(ends[widest] + ends[widest + 1])


def _stability(L: DelaySystem, curve: Curve, table: MarginTable) -> tuple[RealArray, tuple[Interval, ...]]:
    """Stable or not at each delay, and the intervals."""
    delays = table.delays
    if curve.features.ceiling >= 1:  # any delay lets infinitely many roots into Re s > 0
        at_zero = bool(np.any(delays == 0)) and is_stable(L, float(table.modulus_margin[delays == 0][0]))
        return (delays == 0) & at_zero, ((0.0, 0.0),) if at_zero else ()
    if abs(1 + curve.features.at_zero) <= MARGINAL:
        return np.zeros(len(delays), dtype=bool), ()
    windows = delay_windows(L, float(delays.max()), crossings=table.gains)
    stable = (windows.unstable_counts(delays) == 0) & (table.modulus_margin > MARGINAL)
    return stable, windows.intervals(float(delays.min()), float(delays.max()))


def _checked(delays: ArrayLike) -> RealArray:
    wanted = np.atleast_1d(np.asarray(delays, dtype=float))
    if wanted.ndim != 1 or not wanted.size or not np.all(np.isfinite(wanted)) or np.any(wanted < 0):
        raise AnalysisError(
            "a sweep needs at least one delay, finite and not negative",
            found=str(delays),
            advice="give seconds",
        )
    return wanted
