"""A linear system with delay: a rational system with extra channels, and the list of the channels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from delaytools.linear import evaluation
from delaytools.linear.channel import Channel, Delay
from delaytools.linear.matrices import RealMatrix, joined_diagonally, real_matrix
from delaytools.linear.names import chosen, default_names, joined_names
from delaytools.linear.rational import Realisation, is_number, realised
from delaytools.signals.trouble import AnalysisError

__all__ = ["DelaySystem", "as_delay_system"]

ComplexArray = NDArray[np.complex128]


@final
@dataclass(frozen=True, eq=False)
class DelaySystem:
    """A linear system whose delays are exact, in linear fractional form.

    x' = A x + B1 u + B2 w;  y = C1 x + D11 u + D12 w;  z = C2 x + D21 u + D22 w;  w_i = c_i(s) z_i

    A (n,n), B1 (n,nu), B2 (n,m), C1 (ny,n), D11 (ny,nu), D12 (ny,m), C2 (m,n), D21 (m,nu), D22 (m,m);
    m channels, each a Delay or a Hold; names of the inputs u and the outputs y (default u0, y0, ...).
    `*`, `+`, `-`, unary `-` and `/` number join it with other systems, python-control systems, numbers and
    matrices: each is the rational connection plus the joined channel lists.
    Raises AnalysisError where shapes or names do not fit.
    """

    A: RealMatrix
    B1: RealMatrix
    B2: RealMatrix
    C1: RealMatrix
    C2: RealMatrix
    D11: RealMatrix
    D12: RealMatrix
    D21: RealMatrix
    D22: RealMatrix
    channels: tuple[Channel, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    __array_ufunc__ = None  # numpy numbers and arrays leave * + - to this class

    def __post_init__(self) -> None:
        if np.ndim(self.D11) != 2:
            raise AnalysisError("D11 must have two axes", found=f"shape {np.shape(self.D11)}")
        ny, nu = np.shape(self.D11)
        n, m = (0 if np.size(self.A) == 0 else len(self.A)), len(tuple(self.channels))
        shapes = {
            "A": (n, n), "B1": (n, nu), "B2": (n, m), "C1": (ny, n), "C2": (m, n),
            "D11": (ny, nu), "D12": (ny, m), "D21": (m, nu), "D22": (m, m),
        }  # fmt: skip
        for name, shape in shapes.items():
            object.__setattr__(self, name, real_matrix(getattr(self, name), shape, name=name))
        object.__setattr__(self, "channels", tuple(self.channels))
        object.__setattr__(self, "inputs", default_names(self.inputs, "u", count=nu))
        object.__setattr__(self, "outputs", default_names(self.outputs, "y", count=ny))

    @property
    def n_states(self) -> int:
        """The number of rational states x."""
        return int(self.A.shape[0])

    @property
    def n_channels(self) -> int:
        """The number of delay and hold channels."""
        return len(self.channels)

    @property
    def delays(self) -> tuple[float, ...]:
        """The span of each channel, s: tau of a Delay, the period of a Hold."""
        return tuple(channel.span for channel in self.channels)

    @property
    def shape(self) -> tuple[int, int]:
        """(number of outputs, number of inputs)."""
        return len(self.outputs), len(self.inputs)

    def __call__(self, s: Any) -> ComplexArray:
        """G(s): (ny, nu) for a scalar s, (..., ny, nu) for an array of shape (...); inf at a pole."""
        s = np.asarray(s, dtype=complex)
        values = evaluation.channel_values(self, s)
        right = np.concatenate(
            [np.broadcast_to(self.B1, (*s.shape, *self.B1.shape)), values[..., None] * self.D21], axis=-2
        )
        answer = evaluation.solved(self.characteristic_matrix(s), right)
        with np.errstate(invalid="ignore"):
            reached = np.hstack([self.C1, self.D12]).astype(complex) @ answer + self.D11
        return np.where(np.isfinite(reached), reached, np.inf)

    def siso(self, s: Any) -> ComplexArray:
        """G(s) of a system with one input and one output, in the shape of s."""
        self._require_siso()
        return self(s)[..., 0, 0]

    def frequency_response(self, omega: Any) -> ComplexArray:
        """G(j omega), omega in rad/s of shape (...): (..., ny, nu)."""
        return self(1j * np.asarray(omega, dtype=float))

    def dcgain(self) -> RealMatrix:
        """G(0), shape (ny, nu); inf where s = 0 is a pole."""
        return np.asarray(self(0.0).real)

    def characteristic_matrix(self, s: Any) -> ComplexArray:
        """M(s) = [[sI - A, -B2], [-c(s) C2, I - c(s) D22]], shape (..., n+m, n+m).

        Where Re s < 0 each channel row is multiplied by e^{s span}. det M = 0 at the characteristic roots.
        """
        return evaluation.bordered_matrix(self, s)

    def appended(self, other: "DelaySystem") -> "DelaySystem":
        """Both side by side, not connected: diag(self, other)."""
        pairs = {
            name: joined_diagonally(getattr(self, name), getattr(other, name))
            for name in ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
        }
        return DelaySystem(
            **pairs,
            channels=self.channels + other.channels,
            inputs=joined_names(self.inputs, other.inputs, "u"),
            outputs=joined_names(self.outputs, other.outputs, "y"),
        )

    def connected(self, feedback: Any, *, into: Any, out: Any) -> "DelaySystem":
        """The system wired by u = K y + L e, with the new output H y.

        K = `feedback` (nu,ny), L = `into` (nu,ne), H = `out` (nh,ny); y = (I - D11 K)^-1 (C1 x + D12 w + D11 L e).
        The names are the default ones. Raises AnalysisError where the loop of direct gains I - D11 K is singular.
        """
        K, L, H = (np.asarray(part, dtype=float) for part in (feedback, into, out))
        loop = np.eye(self.shape[0]) - self.D11 @ K
        _require_well_posed(loop, "the connection is not well posed: I - D11 K is singular")
        direct = self.D11 @ L
        y = np.linalg.solve(loop, np.hstack([self.C1, direct, self.D12]))
        Cx, Du, Dw = np.split(y, [self.n_states, self.n_states + L.shape[1]], axis=1)
        KC, KD, KW = K @ Cx, L + K @ Du, K @ Dw
        return DelaySystem(
            A=self.A + self.B1 @ KC, B1=self.B1 @ KD, B2=self.B2 + self.B1 @ KW,
            C1=H @ Cx, D11=H @ Du, D12=H @ Dw,
            C2=self.C2 + self.D21 @ KC, D21=self.D21 @ KD, D22=self.D22 + self.D21 @ KW,
            channels=self.channels,
        )  # fmt: skip

    def named(
        self, *, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> "DelaySystem":
        """The same system with other names of its inputs and outputs."""
        return replace(
            self,
            inputs=self.inputs if inputs is None else tuple(inputs),
            outputs=self.outputs if outputs is None else tuple(outputs),
        )

    def with_spans(self, spans: Sequence[float]) -> "DelaySystem":
        """The same system with other spans (s) of its channels, in order."""
        if len(spans) != self.n_channels:
            raise AnalysisError(f"{self.n_channels} channels need as many spans", found=f"{len(spans)}")
        channels = tuple(c.with_span(span) for c, span in zip(self.channels, spans, strict=True))
        return replace(self, channels=channels)

    def with_channels(self, kept: Sequence[int]) -> "DelaySystem":
        """The part of the system with the channels `kept` (indices); the others deliver w = 0."""
        kept = list(kept)
        return replace(
            self, B2=self.B2[:, kept], C2=self.C2[kept], D12=self.D12[:, kept], D21=self.D21[kept],
            D22=self.D22[np.ix_(kept, kept)], channels=tuple(self.channels[i] for i in kept),
        )  # fmt: skip

    def without_zero_delays(self) -> "DelaySystem":
        """The same system with each transport of 0 s closed into the rational part: w = z.

        Raises AnalysisError where that loop, I - D22 of the closed channels, is singular.
        """
        closed = [i for i, c in enumerate(self.channels) if isinstance(c, Delay) and c.span == 0]
        return self._closed_over(closed) if closed else self

    def __getitem__(self, key: Any) -> "DelaySystem":
        """sys[outputs, inputs]: indices, names, slices or lists of them; a part keeps all states."""
        if not (isinstance(key, tuple) and len(key) == 2):
            raise AnalysisError(
                "a sub-system needs outputs and inputs: sys[outputs, inputs]", found=repr(key)
            )
        rows, columns = chosen(key[0], self.outputs), chosen(key[1], self.inputs)
        return replace(
            self,
            B1=self.B1[:, columns], D21=self.D21[:, columns], C1=self.C1[rows], D12=self.D12[rows],
            D11=self.D11[np.ix_(rows, columns)],
            inputs=tuple(self.inputs[j] for j in columns), outputs=tuple(self.outputs[i] for i in rows),
        )  # fmt: skip

    def __mul__(self, other: Any) -> Any:
        right = _operand(other, self.shape[1])
        return NotImplemented if right is None else _product(self, right)

    def __rmul__(self, other: Any) -> Any:
        left = _operand(other, self.shape[0])
        return NotImplemented if left is None else _product(left, self)

    def __add__(self, other: Any) -> Any:
        right = _summand(other, self.shape)
        return NotImplemented if right is None else _sum(self, right)

    def __radd__(self, other: Any) -> Any:
        left = _summand(other, self.shape)
        return NotImplemented if left is None else _sum(left, self)

    def __sub__(self, other: Any) -> Any:
        right = _summand(other, self.shape)
        return NotImplemented if right is None else _sum(self, -right)

    def __rsub__(self, other: Any) -> Any:
        left = _summand(other, self.shape)
        return NotImplemented if left is None else _sum(left, -self)

    def __neg__(self) -> "DelaySystem":
        return replace(self, C1=-self.C1, D11=-self.D11, D12=-self.D12)

    def __truediv__(self, other: Any) -> Any:
        return self * (1.0 / float(other)) if is_number(other) else NotImplemented

    def _require_siso(self) -> None:
        if self.shape != (1, 1):
            raise AnalysisError(
                "one input and one output are needed",
                found=f"{self.shape[0]} outputs and {self.shape[1]} inputs",
                advice="choose a part by sys[output, input]",
            )

    def _closed_over(self, closed: list[int]) -> "DelaySystem":
        kept = [i for i in range(self.n_channels) if i not in closed]
        loop = np.eye(len(closed)) - self.D22[np.ix_(closed, closed)]
        _require_well_posed(loop, "a loop of zero delay is not well posed: I - D22 is singular")
        rows = np.hstack([self.C2[closed], self.D21[closed], self.D22[np.ix_(closed, kept)]])
        n, nu = self.n_states, self.shape[1]
        X, U, W = np.split(np.linalg.solve(loop, rows), [n, n + nu], axis=1)
        B, Dy, Dz = self.B2[:, closed], self.D12[:, closed], self.D22[np.ix_(kept, closed)]
        return replace(
            self,
            A=self.A + B @ X, B1=self.B1 + B @ U, B2=self.B2[:, kept] + B @ W,
            C1=self.C1 + Dy @ X, D11=self.D11 + Dy @ U, D12=self.D12[:, kept] + Dy @ W,
            C2=self.C2[kept] + Dz @ X, D21=self.D21[kept] + Dz @ U,
            D22=self.D22[np.ix_(kept, kept)] + Dz @ W,
            channels=tuple(self.channels[i] for i in kept),
        )  # fmt: skip


def as_delay_system(value: Any) -> DelaySystem:
    """A DelaySystem from a DelaySystem, a python-control system, a real number or a matrix.

    Raises AnalysisError for anything else, for discrete time and for improper transfer functions.
    """
    if isinstance(value, DelaySystem):
        return value
    found = value if isinstance(value, Realisation) else realised(value)
    if found is None:
        raise AnalysisError(
            "not a linear system",
            found=type(value).__name__,
            known=["DelaySystem", "control.TransferFunction", "control.StateSpace", "number", "matrix"],
        )
    return _of_realisation(found)


def _of_realisation(found: Realisation) -> DelaySystem:
    n, nu, ny = found.A.shape[0], found.D.shape[1], found.D.shape[0]
    return DelaySystem(
        A=found.A, B1=found.B, B2=np.zeros((n, 0)), C1=found.C, C2=np.zeros((0, n)), D11=found.D,
        D12=np.zeros((ny, 0)), D21=np.zeros((0, nu)), D22=np.zeros((0, 0)),
        inputs=_own_names(found.inputs, "u"), outputs=_own_names(found.outputs, "y"),
    )  # fmt: skip


def _own_names(names: tuple[str, ...], letter: str) -> tuple[str, ...]:
    """python-control's default names u[0], y[0] become this project's, u0, y0."""
    return () if all(name == f"{letter}[{i}]" for i, name in enumerate(names)) else names


def _is_scalar(value: Any) -> bool:
    return is_number(value) or isinstance(value, (complex, np.complexfloating))


def _operand(value: Any, size: int) -> DelaySystem | None:
    """A factor: a number is itself times the identity of `size`."""
    if isinstance(value, DelaySystem):
        return value
    found = realised(np.eye(size) * value if _is_scalar(value) else value)
    return None if found is None else _of_realisation(found)


def _summand(value: Any, shape: tuple[int, int]) -> DelaySystem | None:
    """A term: a number stands in every entry of `shape`."""
    if isinstance(value, DelaySystem):
        return value
    found = realised(np.ones(shape) * value if _is_scalar(value) else value)
    return None if found is None else _of_realisation(found)


def _product(left: DelaySystem, right: DelaySystem) -> DelaySystem:
    """left(s) right(s): the signal passes `right` first."""
    if left.shape[1] != right.shape[0]:
        raise AnalysisError(
            "the product of these systems has no meaning",
            found=f"a system of shape {left.shape} times one of shape {right.shape} (outputs, inputs)",
            advice="the inputs of the left one must be as many as the outputs of the right one",
        )
    (ny, k), nu = left.shape, right.shape[1]
    both = left.appended(right)
    wires = np.block([[np.zeros((k, ny)), np.eye(k)], [np.zeros((nu, ny + k))]])
    into = np.vstack([np.zeros((k, nu)), np.eye(nu)])
    wired = both.connected(wires, into=into, out=np.hstack([np.eye(ny), np.zeros((ny, k))]))
    return wired.named(inputs=right.inputs, outputs=left.outputs)


def _sum(left: DelaySystem, right: DelaySystem) -> DelaySystem:
    """left(s) + right(s)."""
    if left.shape != right.shape:
        raise AnalysisError(
            "the sum of these systems has no meaning",
            found=f"shapes {left.shape} and {right.shape} (outputs, inputs)",
            advice="both must have the same shape",
        )
    ny, nu = left.shape
    both = left.appended(right)
    into, out = np.vstack([np.eye(nu)] * 2), np.hstack([np.eye(ny)] * 2)
    wired = both.connected(np.zeros((2 * nu, 2 * ny)), into=into, out=out)
    return wired.named(inputs=left.inputs, outputs=left.outputs)


def _require_well_posed(loop: RealMatrix, problem: str) -> None:
    size = max(1.0, float(np.abs(loop).max(initial=0.0)))
    smallest = np.linalg.svd(loop, compute_uv=False).min(initial=np.inf)
    if smallest < 1e-13 * size:
        raise AnalysisError(
            problem,
            found=f"smallest singular value {smallest:.1e}",
            advice="put a delay or a lag in the loop, or change the gain",
        )
