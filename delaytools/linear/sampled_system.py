"""A linear system with transports and sampled blocks, as records: no algorithm lives here."""

from dataclasses import dataclass
from typing import Literal, final

import numpy as np

from delaytools.linear.matrices import RealMatrix, real_matrix
from delaytools.signals.trouble import AnalysisError

__all__ = ["SampledSystem", "Sampler"]

Row = Literal["x", "z", "q", "y"]
Column = Literal["x", "v", "w", "e"]


@final
@dataclass(frozen=True, eq=False)
class Sampler:
    """One sampled block, linear, ticking at 0, T, 2T, ...; v is held between the ticks.

    x[k+1] = F x[k] + G q[k];  v[k] = H x[k] + D q[k]

    F (n,n), G (n,nq), H (nv,n), D (nv,nq): D says the shape, so that n = 0 is a static block.
    period: T in seconds, > 0.
    Raises AnalysisError where a shape does not fit or the period is not positive.
    """

    period: float
    F: RealMatrix
    G: RealMatrix
    H: RealMatrix
    D: RealMatrix

    def __post_init__(self) -> None:
        if not (np.isfinite(self.period) and self.period > 0):
            raise AnalysisError("a sampler's period must be positive and finite", found=f"{self.period} s")
        n = 0 if np.size(self.F) == 0 else np.shape(self.F)[0]
        if np.ndim(self.D) != 2:
            raise AnalysisError("the matrix D must have two axes", found=f"shape {np.shape(self.D)}")
        nv, nq = np.shape(self.D)
        object.__setattr__(self, "period", float(self.period))
        for name, shape in {"F": (n, n), "G": (n, nq), "H": (nv, n), "D": (nv, nq)}.items():
            object.__setattr__(self, name, real_matrix(getattr(self, name), shape, name=name))

    @property
    def n_states(self) -> int:
        """The number of states kept from tick to tick."""
        return int(self.F.shape[0])

    @property
    def n_inputs(self) -> int:
        """The number of signals q that are read at a tick."""
        return int(self.D.shape[1])

    @property
    def n_outputs(self) -> int:
        """The number of signals v that are held from tick to tick."""
        return int(self.D.shape[0])


    @property
    def steady_gain(self) -> RealMatrix:
        """From q at rest to v at rest, (nv, nq): D + H (I - F)⁺ G."""
        if not self.n_states:
            return self.D
        return np.asarray(self.D + self.H @ np.linalg.pinv(np.eye(self.n_states) - self.F) @ self.G)


@final
@dataclass(frozen=True, eq=False)
class SampledSystem:
    """Continuous states, transports and samplers, wired by one matrix.

    [x'; z; q; y] = M [x; v; w; e];  w_i(t) = z_i(t - delays[i]);  samplers map q to v, in order.

    M (nx+nz+nq+ny, nx+nv+nz+ne), delays in seconds (>= 0), names of inputs e, outputs y and states x.
    Raises AnalysisError where a shape or a count of names does not fit.
    """

    M: RealMatrix
    n_states: int
    delays: tuple[float, ...]
    samplers: tuple[Sampler, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    state_names: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("delays", "samplers", "inputs", "outputs", "state_names"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        object.__setattr__(self, "delays", tuple(float(delay) for delay in self.delays))
        for delay in self.delays:
            if not (np.isfinite(delay) and delay >= 0):
                raise AnalysisError("a delay must be finite and not negative", found=f"{delay} s")
        if len(self.state_names) != self.n_states:
            raise AnalysisError(
                f"{self.n_states} states need as many names", found=f"{len(self.state_names)} names"
            )
        shape = (sum(self.row_sizes.values()), sum(self.column_sizes.values()))
        object.__setattr__(self, "M", real_matrix(self.M, shape, name="M"))

    @property
    def n_transports(self) -> int:
        """The number of transports, that is of z and of w."""
        return len(self.delays)

    @property
    def n_sampled_inputs(self) -> int:
        """The number of signals q read by samplers."""
        return sum(sampler.n_inputs for sampler in self.samplers)

    @property
    def n_sampled_outputs(self) -> int:
        """The number of held signals v."""
        return sum(sampler.n_outputs for sampler in self.samplers)

    @property
    def row_sizes(self) -> dict[Row, int]:
        """The number of rows of M under each of x, z, q, y, in this order."""
        return {
            "x": self.n_states,
            "z": self.n_transports,
            "q": self.n_sampled_inputs,
            "y": len(self.outputs),
        }

    @property
    def column_sizes(self) -> dict[Column, int]:
        """The number of columns of M under each of x, v, w, e, in this order."""
        return {
            "x": self.n_states,
            "v": self.n_sampled_outputs,
            "w": self.n_transports,
            "e": len(self.inputs),
        }

    def rows(self, name: Row) -> slice:
        """Where the rows of x (that is x'), z, q or y stand in M."""
        return _place({str(row): size for row, size in self.row_sizes.items()}, name)

    def columns(self, name: Column) -> slice:
        """Where the columns of x, v, w or e stand in M."""
        return _place({str(column): size for column, size in self.column_sizes.items()}, name)

    def block(self, row: Row, column: Column) -> RealMatrix:
        """The part of M that maps `column` (x, v, w, e) to `row` (x for x', z, q, y); read-only view."""
        return self.M[self.rows(row), self.columns(column)]


def _place(sizes: dict[str, int], name: str) -> slice:
    if name not in sizes:
        raise AnalysisError("no such part of M", found=repr(name), known=sizes)
    start = 0
    for known, size in sizes.items():
        if known == name:
            return slice(start, start + size)
        start += size
    raise AssertionError(name)
