"""A linear state-space block."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value
from delaytools.signals.trouble import DesignError

__all__ = ["StateSpace"]

Matrix = tuple[tuple[Scalar, ...], ...]


@final
@dataclass(frozen=True, kw_only=True)
class StateSpace(Continuous):
    """x' = A x + B u, y = C x + D u; A (n, n), B (n, m), C (p, n), D (p, m), rows as lists; D = 0 where missing."""

    A: Matrix = value(many=True)
    B: Matrix = value(many=True)
    C: Matrix = value(many=True)
    D: Matrix | None = value(default=None, many=True)

    def __post_init__(self) -> None:
        n, m, p = len(self.A), len(self.B[0]) if self.B else 0, len(self.C)
        shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
        for name, (rows, columns) in shapes.items():
            matrix = getattr(self, name)
            if matrix is not None and (len(matrix) != rows or any(len(row) != columns for row in matrix)):
                found = f"{len(matrix)} rows of {sorted({len(row) for row in matrix})}"
                raise DesignError(f"{name} must have {rows} rows of {columns}", found=found)

    @property
    def inputs(self) -> tuple[str, ...]:
        columns = len(self.B[0])
        return ("input",) if columns == 1 else tuple(f"input{k + 1}" for k in range(columns))

    @property
    def outputs(self) -> tuple[str, ...]:
        rows = len(self.C)
        return ("output",) if rows == 1 else tuple(f"output{k + 1}" for k in range(rows))

    @property
    def states(self) -> tuple[str, ...]:
        return tuple(f"x{k + 1}" for k in range(len(self.A)))

    @property
    def initial_state(self) -> tuple[Scalar, ...]:
        return (0.0,) * len(self.A)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return tuple(_dot(a, x) + _dot(b, u) for a, b in zip(self.A, self.B, strict=True))

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        direct = self.D or ((0.0,) * len(u),) * len(self.C)
        return tuple(_dot(c, x) + _dot(d, u) for c, d in zip(self.C, direct, strict=True))


def _dot(row: Sequence[Scalar], vector: Sequence[Scalar]) -> Scalar:
    return sum((k * v for k, v in zip(row, vector, strict=True)), 0.0)
