"""The structured singular value μ of a matrix for a diagonal of complex numbers, between its two bounds."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse.csgraph import connected_components

__all__ = ["StructuredValue", "structured_value"]

RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_POWERS = tuple(4.0**k for k in range(1, 10))  # of singular values: their sum stands ever nearer to the largest one
_STARTS = 6  # random diagonals from which the spectral radius is driven up
_CLOSED = 1e-9  # between the bounds: nothing is left to look for


@final
@dataclass(frozen=True, eq=False)
class StructuredValue:
    """μ(M) = max of ρ(M Δ) over diagonal Δ with |Δ_ii| <= 1, in lower <= μ <= upper; both are reached.

    angles (n,) rad: Δ = diag(e^{jθ}) gives `lower`. upper: σ̄(D M D⁻¹) of a positive diagonal D. For n <= 3 the best
    D gives μ itself (Doyle, IEE Proc. D 129 (1982) 242).
    """

    lower: float
    upper: float
    angles: RealArray


def structured_value(matrix: Any) -> StructuredValue:
    """μ of a square matrix (n, n), real or complex, for n complex numbers on a diagonal.

    Entries that lie on no circle count for nothing: μ is the largest of the strongly connected parts.
    """
    M = np.atleast_2d(np.asarray(matrix, dtype=complex))
    count, label = connected_components(np.abs(M) > 0, directed=True, connection="strong")
    found = StructuredValue(0.0, 0.0, np.zeros(len(M)))
    for part in range(count):
        place = np.flatnonzero(label == part)
        one = _of_connected(M[np.ix_(place, place)])
        angles = found.angles
        if one.lower > found.lower:
            angles = np.zeros(len(M))
            angles[place] = one.angles
        found = StructuredValue(max(found.lower, one.lower), max(found.upper, one.upper), angles)
    return found


def _of_connected(M: ComplexArray) -> StructuredValue:
    if len(M) == 1:
        size = float(np.abs(M[0, 0]))
        return StructuredValue(size, size, -np.angle(M[0]))
    upper, scaled = _scaled(M)
    left, _, right = np.linalg.svd(scaled)
    draw = np.random.default_rng(0)
    # σ u = D M D⁻¹ v with |u| = |v| where the largest σ stands alone: Δ u = v makes u an eigenvector of M Δ
    singular = [-np.angle(u * v) for u, v in zip(left.T, right, strict=True)]
    starts = [*singular, np.zeros(len(M)), *draw.uniform(-np.pi, np.pi, (_STARTS, len(M)))]
    lower, angles = 0.0, np.zeros(len(M))
    for start in starts:
        radius, at = _driven_up(M, start)
        if radius > lower:
            lower, angles = radius, at
        if lower > upper * (1 - _CLOSED):
            break
    return StructuredValue(lower, max(upper, lower), angles)


def _scaled(M: ComplexArray) -> tuple[float, ComplexArray]:
    """σ̄(D M D⁻¹) of the best diagonal D found, and the matrix: log σ̄ is convex in log D.

    By sums of rising powers of the singular values, which are smooth where the largest ones meet.
    """

    def scaled(logarithms: RealArray) -> ComplexArray:
        return M * np.exp(logarithms[:, None] - logarithms[None, :])

    def cost(logarithms: RealArray, power: float) -> tuple[float, RealArray]:
        left, sizes, right = np.linalg.svd(scaled(logarithms))
        weights = (sizes / sizes[0]) ** power
        total = float(weights.sum())
        slope = (np.abs(left) ** 2 - np.abs(right.T) ** 2) @ weights / total
        return float(np.log(sizes[0]) + np.log(total) / power), slope

    at = np.zeros(len(M))
    best, kept = float(np.linalg.norm(M, 2)), M
    for power in _POWERS:
        at = minimize(cost, at, args=(power,), jac=True, method="BFGS", options={"gtol": 1e-10}).x
        at = at - at.mean()
        size = float(np.linalg.norm(scaled(at), 2))
        if size < best:
            best, kept = size, scaled(at)
    return best, kept


def _driven_up(M: ComplexArray, start: RealArray) -> tuple[float, RealArray]:
    """The largest ρ(M diag(e^{jθ})) that is reached uphill from θ = start, and θ there."""

    def cost(angles: RealArray) -> tuple[float, RealArray]:
        turned = M * np.exp(1j * angles)[None, :]
        values, vectors = np.linalg.eig(turned)
        place = int(np.argmax(np.abs(values)))
        size = float(np.abs(values[place]))
        if size == 0.0:
            return 0.0, np.zeros(len(M))
        left = np.linalg.solve(vectors.conj().T, np.eye(len(M))[place])
        return -float(np.log(size)), np.imag(left.conj() * vectors[:, place])

    with np.errstate(all="ignore"):
        found = minimize(cost, start, jac=True, method="BFGS", options={"gtol": 1e-10})
    return float(np.exp(-found.fun)), np.asarray(found.x)
