"""Read-only float matrices for the frozen records of this room."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from delaytools.signals.trouble import AnalysisError

__all__ = ["RealMatrix", "joined_diagonally", "real_matrix"]

RealMatrix = NDArray[np.float64]


def real_matrix(values: ArrayLike, shape: tuple[int, int], *, name: str) -> RealMatrix:
    """A read-only float copy of `values`, whose shape must be `shape`.

    An empty list stands for any matrix without entries.
    Raises AnalysisError where the shape differs or an entry is not a finite real number.
    """
    if np.iscomplexobj(values):
        raise AnalysisError(f"the matrix {name} must be real", advice="give real coefficients")
    matrix = np.array(values, dtype=float)
    if matrix.size == 0 and 0 in shape:
        matrix = np.zeros(shape)
    if matrix.shape != shape:
        raise AnalysisError(f"the matrix {name} must have shape {shape}", found=f"shape {matrix.shape}")
    if not np.all(np.isfinite(matrix)):
        raise AnalysisError(f"the matrix {name} must be finite", found="nan or inf among its entries")
    matrix.flags.writeable = False
    return matrix


def joined_diagonally(first: RealMatrix, second: RealMatrix) -> RealMatrix:
    """The block-diagonal matrix [first, 0; 0, second]; empty blocks keep their rows and columns."""
    rows, columns = first.shape
    joined = np.zeros((rows + second.shape[0], columns + second.shape[1]))
    joined[:rows, :columns] = first
    joined[rows:, columns:] = second
    return joined
