"""Linear states under a broken-line input, exact (matrix exponential), one 2 x 2 or 1 x 1 system per lane."""

import numpy as np
from scipy.linalg import expm

Array = np.ndarray


class Exact:
    """x' = A x + B u for every lane; within a step u runs linearly from a to b."""

    def __init__(self, A: Array, B: Array, step: float) -> None:
        lanes, size = B.shape
        parts = [_discrete(A[i], B[i], step) for i in range(lanes)]
        self.phi = np.array([p[0] for p in parts]).transpose(1, 2, 0).copy()
        self.from_a = np.array([p[1] for p in parts]).T.copy()
        self.from_b = np.array([p[2] for p in parts]).T.copy()
        self.state = np.zeros((size, lanes))

    def run(self, a: Array, b: Array) -> Array:
        """States at the start, and after every step: (steps + 1) x states x lanes."""
        count, size = len(a), len(self.state)
        drive = self.from_a[None] * a[:, None, :] + self.from_b[None] * b[:, None, :]
        path = np.empty((count + 1, size, a.shape[1]))
        path[0] = self.state
        phi = self.phi
        if size == 1:
            factor = phi[0, 0]
            for j in range(count):
                path[j + 1, 0] = factor * path[j, 0] + drive[j, 0]
        else:
            for j in range(count):
                x = path[j]
                path[j + 1] = phi[:, 0] * x[0] + phi[:, 1] * x[1] + drive[j]
        self.state = path[-1].copy()
        return path


def _discrete(A: Array, B: Array, step: float) -> tuple[Array, Array, Array]:
    """Transition matrix and the weights of the input at both ends of a step (Van Loan's bordered matrix)."""
    size = len(B)
    big = np.zeros((size + 2, size + 2))
    big[:size, :size] = A * step
    big[:size, size] = B * step
    big[size, size + 1] = 1.0
    E = expm(big)
    total, end = E[:size, size], E[:size, size + 1]
    return E[:size, :size], total - end, end
