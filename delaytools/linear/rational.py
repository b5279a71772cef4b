"""Rational systems, however they are given, as state-space matrices."""

from dataclasses import dataclass
from typing import Any, final

import control
import numpy as np
from scipy.linalg import matrix_balance

from delaytools.linear.matrices import RealMatrix, joined_diagonally
from delaytools.signals.trouble import AnalysisError

__all__ = ["Realisation", "controllable_form", "is_number", "realised"]


@final
@dataclass(frozen=True, eq=False)
class Realisation:
    """x' = A x + B u; y = C x + D u, with the names of u and y (empty where none were given)."""

    A: RealMatrix
    B: RealMatrix
    C: RealMatrix
    D: RealMatrix
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()


def is_number(value: Any) -> bool:
    """True for a real Python or numpy number, or an array of no axes."""
    return isinstance(value, (int, float, np.integer, np.floating)) or (
        isinstance(value, np.ndarray) and value.ndim == 0 and not np.iscomplexobj(value)
    )


def realised(value: Any) -> Realisation | None:
    """The state-space form of a python-control system, a number or a matrix; None for anything else.

    A vector becomes a row. Raises AnalysisError for discrete time, an improper transfer function,
    complex coefficients or frequency data.
    """
    if isinstance(value, control.FrequencyResponseData):
        raise AnalysisError(
            "frequency data are no system", found=f"{len(value.omega)} frequencies",
            advice="join data with data: frequency_data(system, data.omega) * data",
        )  # fmt: skip
    if isinstance(value, (control.TransferFunction, control.StateSpace)):
        _require_continuous(value)
        found = _of_states(value) if isinstance(value, control.StateSpace) else _of_transfer_function(value)
        return Realisation(
            found.A, found.B, found.C, found.D, tuple(value.input_labels), tuple(value.output_labels)
        )
    if is_number(value) or (isinstance(value, (np.ndarray, list)) and np.ndim(value) <= 2):
        return _of_gain(value)
    return None


def _require_continuous(system: Any) -> None:
    if system.dt not in (0, None) or system.dt is True:
        raise AnalysisError(
            "a sampled (discrete-time) system cannot join a system with continuous delay",
            found=f"dt = {system.dt}",
            advice="use a continuous system (dt = 0), or describe it as a sampled block of the loop",
        )


def _of_gain(value: Any) -> Realisation:
    if np.iscomplexobj(value):
        raise AnalysisError("a gain must be real", found=f"{value}")
    gain = np.atleast_2d(np.asarray(value, dtype=float))
    rows, columns = gain.shape
    return Realisation(np.zeros((0, 0)), np.zeros((0, columns)), np.zeros((rows, 0)), gain)


def _of_states(system: Any) -> Realisation:
    A, B, C, D = (np.asarray(part, dtype=float) for part in _shaped(system))
    return Realisation(A, B, C, D)


def _shaped(system: Any) -> tuple[Any, ...]:
    n, rows, columns = system.nstates, system.noutputs, system.ninputs
    return (
        np.reshape(system.A, (n, n)),
        np.reshape(system.B, (n, columns)),
        np.reshape(system.C, (rows, n)),
        np.reshape(system.D, (rows, columns)),
    )


def _of_transfer_function(system: Any) -> Realisation:
    """One controllable form per input and denominator: equal denominators in a column share states."""
    rows, columns = system.noutputs, system.ninputs
    whole = Realisation(
        np.zeros((0, 0)), np.zeros((0, columns)), np.zeros((rows, 0)), np.zeros((rows, columns))
    )
    for column in range(columns):
        groups: dict[tuple[float, ...], list[int]] = {}
        for row in range(rows):
            groups.setdefault(tuple(_trimmed(system.den_list[row][column])), []).append(row)
        for denominator, members in groups.items():
            numerators = [_trimmed(system.num_list[row][column]) for row in members]
            whole = _with_column(whole, column, members, controllable_form(numerators, list(denominator)))
    return whole


def _with_column(whole: Realisation, column: int, members: list[int], part: Realisation) -> Realisation:
    rows, columns = whole.D.shape
    n = part.A.shape[0]
    inputs, outputs, direct = np.zeros((n, columns)), np.zeros((rows, n)), whole.D.copy()
    inputs[:, column] = part.B[:, 0]
    outputs[members] = part.C
    direct[members, column] = part.D[:, 0]
    return Realisation(
        joined_diagonally(whole.A, part.A),
        np.vstack([whole.B, inputs]),
        np.hstack([whole.C, outputs]),
        direct,
    )


def controllable_form(numerators: list[list[float]], denominator: list[float]) -> Realisation:
    """Controllable companion form of several numerators over one denominator, balanced by powers of 2."""
    n = len(denominator) - 1
    if any(len(numerator) > n + 1 for numerator in numerators):
        raise AnalysisError(
            "an improper transfer function has no state-space form",
            found=f"numerator of degree {max(map(len, numerators)) - 1} over degree {n}",
            advice="add the poles that the hardware has",
        )
    monic = np.array(denominator) / denominator[0]
    padded = np.array([[0.0] * (n + 1 - len(numerator)) + list(numerator) for numerator in numerators])
    padded = padded / denominator[0]
    direct = padded[:, :1]
    A = np.vstack([-monic[1:][None, :], np.eye(n)[:-1]]) if n else np.zeros((0, 0))
    B, C = np.eye(n)[:, :1], padded[:, 1:] - direct * monic[1:]
    if n > 1:
        A, (scale, _) = matrix_balance(A, permute=False, separate=True)
        B, C = B / scale[:, None], C * scale
    return Realisation(A, B, C, direct)


def _trimmed(polynomial: Any) -> list[float]:
    if np.iscomplexobj(polynomial):
        raise AnalysisError("a transfer function must have real coefficients", found=f"{polynomial}")
    coefficients = np.trim_zeros(np.atleast_1d(np.asarray(polynomial, dtype=float)), "f")
    return [float(value) for value in coefficients] if coefficients.size else [0.0]
