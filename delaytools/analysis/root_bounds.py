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
_FAR_ENOUGH = 0.05


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
    """The same loop with c_i - gamma_i in place of each channel c_i.

    det M(s) = det(sI - A) det(I - (c - gamma) P(s)) constant, P(s) = C (sI - A)^-1 B + D
    """

    gamma: RealMatrix
    A: RealMatrix
    B: RealMatrix
    C: RealMatrix
    D: RealMatrix
    poles: NDArray[np.complex128]


def shifted_loop(system: DelaySystem, left: float) -> ShiftedLoop:
    """The loop with that gamma, among a few, that keeps the eigenvalues of A best off Re s = left.

    The gammas differ from channel to channel: where channels cancel each other, a common one would leave a
    root of the system among the eigenvalues.
    """
    loops = [_shifted(system, gamma) for gamma in _gammas(system.n_channels)]
    return max((loop for loop in loops if loop is not None), key=lambda loop: _clearance(loop, left))


def _gammas(m: int) -> list[RealMatrix]:
    index = np.arange(1, m + 1)
    return [np.zeros(m), np.ones(m), *(0.9 * np.cos(turn * index) for turn in (1.0, 2.4, 0.37, 1.7))]


def _clearance(loop: ShiftedLoop, left: float) -> float:
    """How far the eigenvalues stay off the line, in sum of logarithms: those that no gamma moves do not decide."""
    size = np.abs(loop.poles).max(initial=abs(left)) or 1.0
    distance = np.minimum(np.abs(loop.poles.real - left) / size, _FAR_ENOUGH)
    return float(np.sum(np.log(distance + 1e-9)) - 1e-3 * np.abs(loop.gamma).sum())


def _shifted(system: DelaySystem, gamma: RealMatrix) -> ShiftedLoop | None:
    loop = np.eye(system.n_channels) - system.D22 * gamma
    if loop.size and np.linalg.cond(loop) > 1e8:
        return None
    # z = C2 x + D22 (gamma z + d), w = gamma z + d, with d the new channels' outputs
    C, D = (np.asarray(np.linalg.solve(loop, part), dtype=float) for part in (system.C2, system.D22))
    A = system.A + (system.B2 * gamma) @ C
    B = system.B2 + (system.B2 * gamma) @ D
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
