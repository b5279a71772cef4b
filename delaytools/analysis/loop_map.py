"""The stability map of a loop: over an extra delay, and a factor, a second delay, any number or time."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.crossings import gain_crossings
from delaytools.analysis.delay_sweep import delay_windows
from delaytools.analysis.map_curves import CrossingCurve, Span
from delaytools.analysis.map_rows import Row, joined_rows
from delaytools.analysis.margins import curve_of
from delaytools.analysis.opened_loop import OpenedLoop, open_loop, opened_at_transports, scaled_transport
from delaytools.analysis.questions import APPROXIMATE
from delaytools.analysis.sampled_margins import pulse_crossings
from delaytools.analysis.stability_map import POINTS, StabilityMap, checked, delay_factor_map, two_delay_map
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.hold_approximation import continuous_approximation
from delaytools.linear.lifted import lift
from delaytools.linear.sampled_system import SampledSystem
from delaytools.loop.loop import Loop
from delaytools.loop.values import with_numbers
from delaytools.signals.trouble import AnalysisError

__all__ = ["TIME", "loop_map"]

TIME = "time"
Array = NDArray[np.float64]


def loop_map(
    loop: Loop,
    at: str,
    delays: Span,
    *,
    delay_at: str | None = None,
    gains: Span | None = None,
    second: tuple[str, Span] | None = None,
    number: tuple[str, Span] | None = None,
) -> StabilityMap:
    """Where the closed loop is stable over an extra delay (s, x) and one thing more (y).

    gains: a factor on the signal `at`. second: (port, range) of another extra delay in s. number: (path, range) of any
    value of the design, or ("time", range in s): moments of a run at which what depends on time stands still. Curves
    are closed forms in frequency, but over a number, over time, and in a sampled loop over a factor, rows of exact
    crossings joined. Sampled loops: exact over a factor on a signal of the one rate; elsewhere the continuous
    approximation. Raises AnalysisError where not one is given.
    """
    given = [one for one in (gains, second, number) if one is not None]
    if len(given) != 1:
        advice = "give a range of gains, of a second delay, of a number or of time"
        raise AnalysisError("a map has one second parameter", found=f"{len(given)}", advice=advice)
    if number is not None:
        path = number[0]

        def loop_at(y: float) -> Loop:
            return replace(loop, moment=y) if path == TIME else with_numbers(loop, {path: y})

        return _over_rows(lambda y: open_loop(loop_at(y), at, delay_at), delays, number)
    opened = open_loop(loop, at, delay_at, second[0] if second else None)
    sampling = APPROXIMATE if opened.opened.samplers else "exact"
    if gains is not None and opened.opened.samplers and opened.exact_sampling:
        found, sampling = _sampled(opened, delays, gains), "exact"
    elif gains is not None:
        found = delay_factor_map(_opened(opened, (opened.extra_closed, opened.closing)), delays, gains)
    else:
        assert second is not None and opened.second is not None
        found = two_delay_map(_opened(opened, (opened.extra_closed, opened.second)), delays, second[1])
    return replace(found, sampling=sampling, linearised_without=opened.without)


def _opened(opened: OpenedLoop, chosen: tuple[int, int]) -> DelaySystem:
    """P: what enters two transports of the closed loop over what leaves them."""
    return continuous_approximation(opened_at_transports(opened.closed_at(0.0), chosen))


def _over_rows(opened_at: Callable[[float], OpenedLoop], delays: Span, along: tuple[str, Span]) -> StabilityMap:
    """Rows of crossings in delay, one for each value of what goes along y."""
    path, values = along
    checked(delays, values)
    seen: list[OpenedLoop] = []

    def row(value: float) -> Row:
        opened = opened_at(value)
        seen.append(opened)
        around = opened.around_extra()
        if curve_of(around).features.ceiling >= 1:
            found = f"{path} = {value:g}"
            raise AnalysisError("every delay, however small, lets roots without end into Re s > 0", found=found)
        windows = delay_windows(around, delays[1])
        inside = (windows.delays > delays[0]) & (windows.change != 0)
        first = int(windows.unstable_counts(np.array([delays[0]]))[0])
        frequency = _frequencies(around, windows.delays[inside])
        counts = first + np.concatenate([[0], np.cumsum(windows.change[inside])])
        return Row(windows.delays[inside], frequency, counts.astype(int))

    x, y = (np.linspace(*span, n) for span, n in zip((delays, values), POINTS, strict=True))
    curves, rows = joined_rows(row, y.tolist(), delays[1] - delays[0])
    counts = np.stack([one.counted(x) for one in rows])
    sampling = APPROXIMATE if seen[0].opened.samplers else "exact"
    return StabilityMap(("delay", path), (delays, values), curves, x, y, counts, sampling, seen[0].without)


def _frequencies(around: DelaySystem, delays: Array) -> Array:
    """At each delay that brings a pair to the axis, its frequency."""
    omega = gain_crossings(curve_of(around)).omega
    off = np.abs(1 + around.siso(1j * omega)[None, :] * np.exp(-1j * omega[None, :] * delays[:, None]))
    return omega[np.argmin(off, axis=1)] if len(delays) else np.zeros(0)


def _sampled(opened: OpenedLoop, delays: Span, gains: Span) -> StabilityMap:
    """Columns of crossings in the factor, one for each delay, of the exact pulse transfer."""
    checked(delays, gains)
    if gains[0] <= 0:
        raise AnalysisError("a factor is above 0", found=f"{gains[0]:g}")

    def column(tau: float) -> Row:
        found = pulse_crossings(opened.sampled(tau))
        factor = 1 / found.gain
        order = np.argsort(factor)
        order = order[(factor[order] > gains[0]) & (factor[order] < gains[1])]
        edges = np.concatenate([[gains[0]], factor[order], [gains[1]]])
        closed = opened.closed_at(tau)
        counts = [_outside(closed, opened.closing, float(np.sqrt(a * b))) for a, b in pairwise(edges)]
        kept = np.diff(counts) != 0
        return Row(factor[order][kept], found.omega[order][kept], np.array([counts[0], *np.array(counts[1:])[kept]]))

    x, y = (np.linspace(*span, n) for span, n in zip((delays, gains), POINTS[::-1], strict=True))
    upright, columns = joined_rows(column, x.tolist(), gains[1] - gains[0])
    curves = tuple(CrossingCurve(one.y, one.x, one.frequency, one.towards[:, ::-1]) for one in upright)
    counts = np.stack([one.counted(y) for one in columns], axis=1)
    return StabilityMap(("delay", "gain"), (delays, gains), curves, x, y, counts)


def _outside(closed: SampledSystem, closing: int, factor: float) -> int:
    """Multipliers outside the unit circle with a factor on the opened signal."""
    lifted = lift(scaled_transport(closed, closing, factor))
    assert lifted is not None
    return int(np.sum(np.abs(lifted.multipliers) > 1))
