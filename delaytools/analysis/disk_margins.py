"""Disk margins of several signals at once: gains and phases that change together, each in its own way."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.frequency_net import frequency_net
from delaytools.analysis.stability import roots_not_left
from delaytools.analysis.structured_value import StructuredValue, structured_value
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.hold_approximation import continuous_approximation
from delaytools.loop.edit import cut, held_at, reader
from delaytools.loop.linearise import linearise
from delaytools.loop.loop import Loop
from delaytools.loop.trim import readers_at_rest
from delaytools.loop.values import resolve

__all__ = ["DiskMargin", "loop_disk_margin", "simultaneous_disk_margin"]

RealArray = NDArray[np.float64]

_FINER = 3  # times the net is made finer around its highest peak
_ZOOMS = 12
_SWEEPS = 4


@final
@dataclass(frozen=True)
class DiskMargin:
    """margin: α of σ = 0 (0 where the loop is not stable); frequency: rad/s at which it is decided.

    gain: every factor in [1/gain, gain], and phase: every angle within ±phase (rad), on all signals at once, keeps the
    loop stable; inf and π where α reaches 2. at_most: no smaller upper bound of α was found.
    """

    signals: tuple[str, ...]
    margin: float
    frequency: float
    gain: float
    phase: float
    at_most: float


def loop_disk_margin(loop: Loop, signals: Sequence[str]) -> DiskMargin:
    """The simultaneous disk margin of a loop opened at several signals; sampled blocks as continuous ones.

    Raises DesignError for a signal that no block writes.
    """
    opened = closed = resolve(loop)
    for name in signals:
        opened = cut(opened, name)
    opened = held_at(opened, readers_at_rest(closed, signals))
    found = linearise(opened, [reader(name) for name in signals], list(signals))
    return simultaneous_disk_margin(-continuous_approximation(found.system), signals)


def simultaneous_disk_margin(L: DelaySystem, signals: Sequence[str] = ()) -> DiskMargin:
    """α = 1 / sup_ω μ(S - I/2), S = (I + L)⁻¹, μ for a diagonal of complex numbers, one for each signal.

    For one signal it is `disk_margin` of `margins`. Source: Seiler, Packard & Gahinet, IEEE Control Systems 40 (2020)
    78, sec. "MIMO disk margins", with σ = 0. μ is bounded from both sides; `margin` takes the upper bound.
    """
    names = tuple(signals) or L.outputs
    unit = np.eye(L.shape[0])
    closed = L.connected(-unit, into=unit, out=unit)  # T = L S
    if roots_not_left(closed) > 0:
        return DiskMargin(names, 0.0, float("nan"), 1.0, 0.0, 0.0)
    net = frequency_net(closed)
    top, at = _highest(closed, net)
    place = int(np.argmin(np.abs(net - at)))
    low, high = net[max(place - 1, 0)], net[min(place + 1, len(net) - 1)]
    for _ in range(_ZOOMS):
        finer = np.linspace(low, high, 2 * _FINER + 1)
        found, where = _highest(closed, finer)
        if found.upper > top.upper:
            top, at = found, where
        place = int(np.argmin(np.abs(finer - at)))
        low, high = finer[max(place - 1, 0)], finer[min(place + 1, len(finer) - 1)]
    far = structured_value(unit / 2 - closed.D11)
    if far.upper > top.upper:
        top, at = far, np.inf
    alpha = 1.0 / top.upper
    gain = (2 + alpha) / (2 - alpha) if alpha < 2 * (1 - 1e-12) else np.inf
    phase = 2 * np.arctan(alpha / 2) if alpha < 2 * (1 - 1e-12) else np.pi
    return DiskMargin(names, alpha, float(at), float(gain), float(phase), 1.0 / top.lower)


def _highest(closed: DelaySystem, omega: RealArray) -> tuple[StructuredValue, float]:
    """The largest μ(I/2 - T(jω)) over the frequencies, and where; asked first where a cheap bound is highest."""
    matrices = np.eye(closed.shape[0]) / 2 - closed(1j * omega)
    bounds = _cheap_bounds(matrices)
    best, at = StructuredValue(0.0, 0.0, np.zeros(len(matrices[0]))), float(omega[0])
    for k in np.argsort(-bounds):
        if bounds[k] <= best.upper:
            break
        found = structured_value(matrices[k])
        if found.upper > best.upper:
            best, at = found, float(omega[k])
    return best, at


def _cheap_bounds(matrices: NDArray[np.complex128]) -> RealArray:
    """σ̄(D M D⁻¹) of diagonals D that make rows and columns alike (Osborne, J. ACM 7 (1960) 338): no less than μ."""
    n = matrices.shape[-1]
    M = matrices.copy()
    for _ in range(_SWEEPS):
        for i in range(n):
            others = [k for k in range(n) if k != i]
            row, column = (np.linalg.norm(part, axis=-1) for part in (M[:, i, others], M[:, others, i]))
            with np.errstate(all="ignore"):
                scale = np.sqrt(column / row)
            scale = np.where(np.isfinite(scale) & (scale > 0), scale, 1.0)
            M[:, i, :] *= scale[:, None]
            M[:, :, i] /= scale[:, None]
    return np.linalg.norm(M, 2, axis=(-2, -1)) * (1 + 1e-12)
