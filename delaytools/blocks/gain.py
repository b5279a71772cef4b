"""A gain, scalar or matrix."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value

__all__ = ["Gain"]


@final
@dataclass(frozen=True, kw_only=True)
class Gain(Continuous):
    """y = K u, with K a number, or a matrix with one row per output and one column per input."""

    gain: Scalar | tuple[tuple[Scalar, ...], ...] = value(default=1.0, many=True)

    @property
    def _matrix(self) -> tuple[tuple[Scalar, ...], ...]:
        return self.gain if isinstance(self.gain, tuple) else ((self.gain,),)

    @property
    def inputs(self) -> tuple[str, ...]:
        columns = len(self._matrix[0])
        return ("input",) if columns == 1 else tuple(f"input{k + 1}" for k in range(columns))

    @property
    def outputs(self) -> tuple[str, ...]:
        rows = len(self._matrix)
        return ("output",) if rows == 1 else tuple(f"output{k + 1}" for k in range(rows))

    states = ()
    initial_state = ()

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return tuple(sum(k * v for k, v in zip(row, u, strict=True)) for row in self._matrix)
