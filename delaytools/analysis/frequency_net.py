"""The frequencies at which something can happen in a linear system with delay: where to look for crossings."""

import numpy as np
from numpy.typing import NDArray

from delaytools.linear.delay_system import DelaySystem

__all__ = ["PER_DECADE", "frequency_net"]

RealArray = NDArray[np.float64]
PER_DECADE = 32
_TURN = 0.3  # rad, by which all delays together turn from one frequency to the next
_TURNS = 1500  # of these steps at most


def frequency_net(system: DelaySystem) -> RealArray:
    """ω (n,) in rad/s: logarithmic, closer at light modes, and fine enough for the turns of the delays."""
    closed = np.eye(system.n_channels) - system.D22
    poles = [np.linalg.eigvals(system.A)] if system.n_states else [np.zeros(0)]
    if system.n_channels and system.n_states and np.linalg.cond(closed) < 1e12:
        poles.append(np.linalg.eigvals(system.A + system.B2 @ np.linalg.solve(closed, system.C2)))
    points = np.concatenate(poles)
    sizes = np.abs(points)
    spans = np.array([span for span in system.delays if span > 0])
    known = sizes[sizes > 1e-9 * sizes.max(initial=0.0)]
    scales = np.concatenate([known, 1.0 / spans]) if known.size + spans.size else np.ones(1)
    low, high = 0.02 * scales.min(), 30.0 * scales.max()
    grids = [np.geomspace(low, high, max(64, int(PER_DECADE * np.log10(high / low))))]
    for point in points[(points.imag > 0) & (np.abs(points.real) < 0.3 * sizes)]:
        width = max(abs(point.real), 1e-4 * abs(point))
        steps = width * np.geomspace(0.3, max(0.6, 0.3 * abs(point) / width), 12)
        grids += [point.imag - steps, np.array([point.imag]), point.imag + steps]
    if spans.size:
        step = _TURN / spans.sum()
        grids.append(np.arange(step, min(high, _TURNS * step), step))
    every = np.unique(np.concatenate(grids))
    return every[every > 0.5 * low]
