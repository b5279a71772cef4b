"""Connections of linear systems with delay; each is the rational connection plus the joined channel lists."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import svd

from delaytools.linear.channel import Channel, Delay, Hold
from delaytools.linear.delay_system import DelaySystem, as_delay_system
from delaytools.linear.matrices import RealMatrix
from delaytools.linear.rational import is_number
from delaytools.signals.trouble import AnalysisError

__all__ = ["append", "delay", "feedback", "from_delay_differential", "hold", "parallel", "series"]


def delay(seconds: float, n: int = 1) -> DelaySystem:
    """A transport of n signals: y(t) = u(t - tau), G(s) = e^{-s tau} I; tau = `seconds` >= 0.

    Raises AnalysisError where tau is negative or not finite.
    """
    return _of_channel(Delay(seconds), n)


def hold(period: float, n: int = 1) -> DelaySystem:
    """The continuous approximation of a sampled hold of n signals: (1 - e^{-sT})/(sT) I; T = `period` > 0, s.

    Raises AnalysisError where T is not positive.
    """
    return _of_channel(Hold(period), n)


def series(first: Any, second: Any) -> DelaySystem:
    """The signal passes `first`, then `second`: G = second(s) first(s); AnalysisError where shapes differ."""
    return as_delay_system(second) * as_delay_system(first)


def parallel(first: Any, second: Any) -> DelaySystem:
    """Both read the same input and are summed: G = first(s) + second(s); AnalysisError where shapes differ."""
    return as_delay_system(first) + as_delay_system(second)


def append(*systems: Any) -> DelaySystem:
    """Systems side by side, not connected: G = diag(G1, G2, ...)."""
    if not systems:
        raise AnalysisError("nothing to append", advice="give at least one system")
    whole = as_delay_system(systems[0])
    for other in systems[1:]:
        whole = whole.appended(as_delay_system(other))
    return whole


def feedback(system: Any, other: Any = 1, sign: int = -1) -> DelaySystem:
    """The closed loop u = r + sign H y, y = G u: T = (I - sign G H)^-1 G; H = `other`, a number means H = h I.

    Raises AnalysisError where the shapes differ, the sign is not 1 or -1, or the loop of direct gains is singular.
    """
    forward = as_delay_system(system)
    ny, nu = forward.shape
    if sign not in (1, -1):
        raise AnalysisError("the sign of a feedback is 1 or -1", found=repr(sign))
    back = as_delay_system(other if not is_number(other) else np.eye(nu, ny) * float(other))
    if back.shape != (nu, ny):
        raise AnalysisError(
            "the feedback does not fit the system",
            found=f"a system of shape {forward.shape} closed by one of shape {back.shape} (outputs, inputs)",
        )
    wires = np.block([[np.zeros((nu, ny)), sign * np.eye(nu)], [np.eye(ny), np.zeros((ny, nu))]])
    into = np.vstack([np.eye(nu), np.zeros((ny, nu))])
    out = np.hstack([np.eye(ny), np.zeros((ny, nu))])
    closed = forward.appended(back).connected(wires, into=into, out=out)
    return closed.named(inputs=forward.inputs, outputs=forward.outputs)


def from_delay_differential(matrices: Sequence[ArrayLike], delays: Sequence[float]) -> DelaySystem:
    """The system without inputs x'(t) = sum_k A_k x(t - tau_k), output y = x.

    matrices: A_k (n,n); delays: tau_k >= 0 in s, as many. A_k of rank r takes r channels.
    Raises AnalysisError where counts or shapes differ.
    """
    if len(matrices) != len(delays) or len(matrices) == 0:
        raise AnalysisError("each matrix needs its delay", found=f"{len(matrices)} and {len(delays)}")
    parts = [np.atleast_2d(np.asarray(matrix, dtype=float)) for matrix in matrices]
    n = parts[0].shape[0]
    if any(part.shape != (n, n) for part in parts):
        raise AnalysisError(
            "the matrices must be square and of one size", found=str([p.shape for p in parts])
        )
    A = sum((part for part, tau in zip(parts, delays, strict=True) if tau == 0), np.zeros((n, n)))
    pairs = [(*_factors(part), tau) for part, tau in zip(parts, delays, strict=True) if tau != 0]
    B2 = np.hstack([np.zeros((n, 0)), *(left for left, _, _ in pairs)])
    C2 = np.vstack([np.zeros((0, n)), *(right for _, right, _ in pairs)])
    m = B2.shape[1]
    channels = tuple(Delay(tau) for left, _, tau in pairs for _ in range(left.shape[1]))
    return DelaySystem(
        A=A, B1=np.zeros((n, 0)), B2=B2, C1=np.eye(n), C2=C2, D11=np.zeros((n, 0)),
        D12=np.zeros((n, m)), D21=np.zeros((m, 0)), D22=np.zeros((m, m)), channels=channels,
    )  # fmt: skip


def _factors(matrix: RealMatrix) -> tuple[RealMatrix, RealMatrix]:
    """matrix = left right with few columns: exact by rows or columns where that is enough, else by SVD."""
    u, sigma, vt = svd(matrix)
    rank = int(np.sum(sigma > 1e-14 * max(sigma.max(initial=0.0), 1e-300)))
    rows = np.flatnonzero(np.any(matrix, axis=1))
    columns = np.flatnonzero(np.any(matrix, axis=0))
    unit = np.eye(matrix.shape[0])
    if len(rows) == rank:
        return unit[:, rows], matrix[rows]
    if len(columns) == rank:
        return matrix[:, columns], unit[columns]
    return u[:, :rank] * sigma[:rank], vt[:rank]


def _of_channel(channel: Channel, n: int) -> DelaySystem:
    empty, unit, zero = np.zeros((0, n)), np.eye(n), np.zeros((n, n))
    return DelaySystem(
        A=np.zeros((0, 0)), B1=empty, B2=empty, C1=empty.T, C2=empty.T,
        D11=zero, D12=unit, D21=unit, D22=zero, channels=(channel,) * n,
    )  # fmt: skip
