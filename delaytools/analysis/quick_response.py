"""ω -> L(jω) for many frequencies at once: one Schur form, then back substitution over all of them."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur

from delaytools.linear.delay_system import DelaySystem

__all__ = ["quick_response"]

RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def quick_response(L: DelaySystem) -> Callable[[RealArray], ComplexArray]:
    """The response of a system with one input and one output, ω (n,) in rad/s; as exact as `L.siso`.

    Where no channel feeds a channel, L = H11 + Σ H1i c_i Hi1 with rational H: H = C (jωI - A)⁻¹ B + D by the
    complex Schur form A = Z T Zᴴ (backward stable, as a solve is). Otherwise `L.siso` itself.
    Raises AnalysisError where L has several inputs or outputs.
    """
    slow = lambda omega: L.siso(1j * np.asarray(omega, dtype=float))  # noqa: E731
    if L.shape != (1, 1) or not L.n_states or L.n_states > 40 or _channels_feed_channels(L):
        return slow
    T, Z = schur(L.A.astype(complex), output="complex")
    into = Z.conj().T @ L.B1[:, 0]
    out = np.vstack([L.C1, L.C2]) @ Z
    back = L.C1[0] @ Z
    driven = Z.conj().T @ L.B2
    direct = np.concatenate([L.D11[:, 0], L.D21[:, 0]])

    def response(omega: RealArray) -> ComplexArray:
        s = 1j * np.asarray(omega, dtype=float)
        with np.errstate(all="ignore"):
            inner = out @ _substituted(T, into, s) + direct[:, None]
            total = inner[0]
            for i, channel in enumerate(L.channels):
                reach = back @ _substituted(T, driven[:, i], s) + L.D12[0, i]
                total = total + reach * channel.value(s) * inner[1 + i]
        return np.where(np.isfinite(total), total, np.inf)

    return response


def _channels_feed_channels(L: DelaySystem) -> bool:
    """Whether D22 or some C2 Aᵏ B2 is not exactly zero, by the pattern of the matrices."""
    reached = L.B2 != 0
    pattern = (L.A != 0).astype(int)
    for _ in range(L.n_states):
        reached = reached | (pattern @ reached.astype(int) > 0)
    return bool(L.D22.any() or np.any((L.C2 != 0).astype(int) @ reached.astype(int)))


def _substituted(T: ComplexArray, right: ComplexArray, s: ComplexArray) -> ComplexArray:
    """(sI - T)⁻¹ b for each s, shape (n, number of s), T upper triangular."""
    n = len(T)
    answer = np.empty((n, s.size), dtype=complex)
    for row in range(n - 1, -1, -1):
        answer[row] = (right[row] + T[row, row + 1 :] @ answer[row + 1 :]) / (s - T[row, row])
    return answer
