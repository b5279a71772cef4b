"""The exact answer of ω²/(s² + 2ζω s + ω²) to a signal given by rows, held or joined by straight lines."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

__all__ = ["Drive", "drive", "responses"]

RealArray = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class Drive:
    """Segments between the kinks of a delayed input and the rows at which the output is wanted.

    steps (k,) s; value, slope (k,) of the input at and over each segment; rows (n,): where they stand among the
    k + 1 ends of segments.
    """

    steps: RealArray
    value: RealArray
    slope: RealArray
    rows: NDArray[np.int64]


def drive(time: RealArray, u: RealArray, delay: float, held: bool) -> Drive:
    """The input u(t - delay) over the rows `time` (n,) s; before the first row it has its first value."""
    kinks = time + delay
    ends = np.union1d(time, kinks[kinks < time[-1]])
    start = ends[:-1]
    if held:
        index = np.searchsorted(kinks, start + 1e-12 * (1 + np.abs(start)), side="right") - 1
        value, slope = u[np.maximum(index, 0)], np.zeros(len(start))
    else:
        late = np.interp(ends, kinks, u)
        value, slope = late[:-1], np.diff(late) / np.maximum(np.diff(ends), 1e-300)
    return Drive(np.diff(ends), value, slope, np.searchsorted(ends, time))


def responses(natural_frequency: float, damping: float, driven: Drive) -> RealArray:
    """(n,3): y at the rows for the input from rest, for y(0) = 1 alone and for y'(0) = 1 alone.

    x' = A x + b u, A = [[0, 1], [-ω², -2ζω]], b = [0, ω²], y = x₁; over a segment of h s with u = u₀ + m t:
    x⁺ = e^{Ah} x + Γ₀ u₀ + Γ₁ m, Γ₀ = A⁻¹(e^{Ah} - I) b, Γ₁ = A⁻¹(Γ₀ - h b). Exact for any h.
    """
    w, h = natural_frequency, driven.steps
    phi = _transition(w, damping, h)
    inverse = np.array([[-2 * damping / w, -1 / w**2], [1.0, 0.0]])
    b = np.array([0.0, w**2])
    gamma0 = w**2 * (phi[:, :, 1] - np.array([0.0, 1.0])) @ inverse.T
    gamma1 = (gamma0 - h[:, None] * b) @ inverse.T
    right = np.zeros((2 * len(h) + 2, 3))
    right[2:, 0] = (gamma0 * driven.value[:, None] + gamma1 * driven.slope[:, None]).ravel()
    right[0, 1] = right[1, 2] = 1.0
    states, _ = dtbtrs(_banded(phi), right, uplo="L", diag="U")  # forward substitution, nothing to factorise
    return np.asarray(states[2 * driven.rows])


def _transition(w: float, damping: float, h: RealArray) -> RealArray:
    """e^{Ah} = e^{-σh}[c I + s (A + σ I)], σ = ζω, c = cosh μh, s = sinh(μh)/μ, μ² = σ² - ω²; (k,2,2)."""
    sigma, square = damping * w, (damping**2 - 1) * w**2
    root = np.sqrt(abs(square))
    if square <= 0:
        fall = np.exp(-sigma * h)
        c, s = fall * np.cos(root * h), fall * h * np.sinc(root * h / np.pi)
    else:  # e^{-σh} cosh and sinh without overflow
        grown, apart = np.exp((root - sigma) * h), np.expm1(-2 * root * h)
        c, s = grown * (1 + apart / 2), -grown * apart / (2 * root)
    return c[:, None, None] * np.eye(2) + s[:, None, None] * np.array([[sigma, 1.0], [-(w**2), -sigma]])


def _banded(phi: RealArray) -> RealArray:
    """Rows x_{k+1} - Φ_k x_k of a lower band matrix, in LAPACK's form: (4, 2k + 2)."""
    k = len(phi)
    band = np.zeros((4, 2 * k + 2))
    band[0] = 1.0
    band[2, 0 : 2 * k : 2], band[1, 1 : 2 * k : 2] = -phi[:, 0, 0], -phi[:, 0, 1]
    band[3, 0 : 2 * k : 2], band[2, 1 : 2 * k : 2] = -phi[:, 1, 0], -phi[:, 1, 1]
    return band
