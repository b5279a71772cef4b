"""Where characteristic roots can be: a box that encloses all roots right of a line, where one exists."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.linear.channel import Delay
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.matrices import RealMatrix
from delaytools.signals.trouble import AnalysisError

__all__ = ["Box", "ShiftedLoop", "enclosing_box", "shifted_loop"]

_LARGEST_EXPONENT = 250.0
_SHIFTS = (0.0, 1.0, 0.5, -0.5, -1.0, 2.0, 0.25)


@final
@dataclass(frozen=True)
class Box:
    """left < Re s < right, |Im s| < top (rad/s); complete: no root right of `left` lies outside."""

    left: float
    right: float
    top: float
    complete: bool


def enclosing_box(system: DelaySystem, spans: RealMatrix, left: float, *, up_to: float | None = None) -> Box:
    """The box of all roots with Re s > left of every row of `spans` (k, m), s.

    A root obeys |s| <= rho(|A| + |B2| (I - E|D22|)^-1 E |C2|), E = diag sup |c_i| right of the line. Where
    rho(E |D22|) >= 1 (a neutral system) infinite chains may reach right of the line: then the box ends at `up_to`,
    by default 20 turns over the shortest transport. Raises AnalysisError for a line too far left to compute with.
    """
    reach = _reach(system, spans, left)
    complete = np.isfinite(reach) and (up_to is None or reach <= up_to)
    top = reach if complete else (up_to or 40 * np.pi / _shortest(system, spans))
    right = max(left + 1.0 / _longest(spans), 1.0 / _longest(spans))
    while not _reach(system, spans, right) < right:
        right = 2.0 * right
    return Box(float(left), float(right * 1.01), float(top * 1.01 + 1.0 / _longest(spans)), bool(complete))


@final
@dataclass(frozen=True, eq=False)
class ShiftedLoop:
    """The same loop with c_i - gamma in place of each channel c_i.

    det M(s) = det(sI - A) det(I - (c - gamma) P(s)) constant, P(s) = C (sI - A)^-1 B + D
    """

    gamma: float
    A: RealMatrix
    B: RealMatrix
    C: RealMatrix
    D: RealMatrix
    poles: NDArray[np.complex128]


def shifted_loop(system: DelaySystem, left: float) -> ShiftedLoop:
    """The loop with the first gamma (0, 1, ...) that keeps the eigenvalues of A well off Re s = left."""
    best, best_clearance = None, -1.0
    for gamma in _SHIFTS:
        loop = _shifted(system, gamma)
        if loop is None:
            continue
        size = np.abs(loop.poles).max(initial=abs(left)) or 1.0
        clearance = np.abs(loop.poles.real - left).min(initial=np.inf) / size
        if clearance > best_clearance:
            best, best_clearance = loop, clearance
        if clearance > 0.02:
            break
    assert best is not None  # gamma = 0 is always possible
    return best


def _shifted(system: DelaySystem, gamma: float) -> ShiftedLoop | None:
    loop = np.eye(system.n_channels) - gamma * system.D22
    if loop.size and np.linalg.cond(loop) > 1e8:
        return None
    C, D = np.linalg.solve(loop, system.C2), np.linalg.solve(loop, system.D22)
    A = system.A + gamma * system.B2 @ C
    B = system.B2 @ (np.eye(system.n_channels) + gamma * D)
    return ShiftedLoop(gamma, A, B, C, D, np.linalg.eigvals(A).astype(complex))


def _reach(system: DelaySystem, spans: RealMatrix, left: float) -> float:
    """The largest modulus of a root right of the line, or inf where none can be given."""
    if np.max(-left * spans, initial=0.0) > _LARGEST_EXPONENT:
        raise AnalysisError(
            "the line Re s = right_of is too far left for these delays",
            found=f"{left:g} rad/s with a delay of {spans.max():g} s",
            advice="ask for roots further right",
        )
    E = np.array([c.kappa(left * spans[:, i]).real.max() for i, c in enumerate(system.channels)])
    feedthrough = E[:, None] * np.abs(system.D22)
    if _spectral_radius(feedthrough) >= 0.999:
        return float("inf")
    gain = np.linalg.solve(np.eye(len(E)) - feedthrough, E[:, None] * np.abs(system.C2))
    return _spectral_radius(np.abs(system.A) + np.abs(system.B2) @ gain)


def _spectral_radius(matrix: RealMatrix) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def _longest(spans: RealMatrix) -> float:
    """The longest span, or 1 s for a system without delay."""
    return float(spans.max(initial=0.0)) or 1.0


def _shortest(system: DelaySystem, spans: RealMatrix) -> float:
    transports = [i for i, channel in enumerate(system.channels) if isinstance(channel, Delay)]
    return float(spans[:, transports].min(initial=np.inf))
