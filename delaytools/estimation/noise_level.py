"""How noisy a column of a log is, without a model."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["difference_noise"]

FEWEST = 16  # rows


def difference_noise(values: NDArray[np.float64]) -> float:
    """Standard deviation of white noise on a smooth signal, rows evenly spaced: median |4th difference|/0.6745/√70.

    √70: of the sum of the squared binomials 1 4 6 4 1. 0 where there are few rows.
    """
    if len(values) < FEWEST:
        return 0.0
    return float(np.median(np.abs(np.diff(values, 4))) / 0.6745 / np.sqrt(70.0))
