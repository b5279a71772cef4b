"""When a linear system with delay is not smooth: jumps and kinks that come back through its delays, ever smoother."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from delaytools.linear.delay_system import DelaySystem

__all__ = ["break_times"]

RealArray = NDArray[np.float64]

SMOOTH = 12  # the order of a derivative whose jump a polynomial of degree 20 no longer feels
_SAME = 1e-12  # of the length of the run: times that are one


def break_times(system: DelaySystem, end: float, begun: Sequence[tuple[float, int]]) -> RealArray:
    """The times in (0, end) at which some signal has a jump in a derivative of order below 12, rising.

    begun: (time, order) of the breaks that the inputs bring (0 = a jump, -1 = an impulse). What passes a channel
    arrives later with its order; what passes a state is one order smoother.
    """
    direct_in = system.D21.any(axis=1) if system.D21.size else np.zeros(system.n_channels, dtype=bool)
    direct = system.D22 != 0
    orders: dict[int, int] = {}
    grain = _SAME * end
    waiting: list[tuple[float, int, int]] = []  # time, order, channel out of which it comes
    found: list[float] = [time for time, order in begun if 0 < time < end and order < SMOOTH]
    for time, order in begun:
        for i, span in enumerate(system.delays):
            waiting.append((time + span, order + (0 if direct_in[i] else 1), i))
    while waiting:
        time, order, channel = waiting.pop()
        if time >= end * (1 - _SAME) or order >= SMOOTH:
            continue
        key = round(time / grain) * (system.n_channels + 1) + channel
        if orders.get(key, SMOOTH) <= order:
            continue
        orders[key] = order
        found.append(time)
        for j, span in enumerate(system.delays):
            waiting.append((time + span, order if direct[j, channel] else order + 1, j))
    times = np.unique(np.array(found))
    return times[np.concatenate([[True], np.diff(times) > 2 * grain])] if times.size else times
