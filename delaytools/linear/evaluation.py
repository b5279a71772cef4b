"""Values of a linear system with delay at complex s, without overflow far left or far right.

The bordered matrix M(s) = [[sI - A, -B2], [-c(s) C2, I - c(s) D22]] acts on (x, w); its channel rows are
multiplied by e^{s span} where Re s < 0. Its zeros are the characteristic roots. Where `spans` are given,
of shape (..., m), they stand in place of the channels' own: many systems that differ by their delays at once.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from delaytools.linear.channel import Channel
from delaytools.linear.matrices import RealMatrix

__all__ = ["bordered_derivative", "bordered_matrix", "channel_scale", "channel_values", "own_spans", "solved"]

ComplexArray = NDArray[np.complex128]


class Fractional(Protocol):
    """What is needed of a system in linear fractional form."""

    @property
    def A(self) -> RealMatrix: ...
    @property
    def B2(self) -> RealMatrix: ...
    @property
    def C2(self) -> RealMatrix: ...
    @property
    def D22(self) -> RealMatrix: ...
    @property
    def channels(self) -> tuple[Channel, ...]: ...


def own_spans(system: Fractional) -> RealMatrix:
    """The spans of the system's channels, s, shape (m,)."""
    return np.array([channel.span for channel in system.channels], dtype=float)


def channel_values(system: Fractional, s: Any, spans: Any = None) -> ComplexArray:
    """c_i(s), times e^{s span_i} where Re s < 0; shape (..., m)."""
    x, left = _arguments(system, s, spans)
    values = np.empty_like(x)
    for i, channel in enumerate(system.channels):
        values[..., i] = _piecewise(channel.kappa, x[..., i], left)
    return values


def channel_scale(system: Fractional, s: Any, spans: Any = None) -> ComplexArray:
    """The factor of each channel row: e^{s span_i} where Re s < 0, else 1; shape (..., m)."""
    x, left = _arguments(system, s, spans)
    return np.exp(np.where(left[..., None], x, 0.0))


def bordered_matrix(system: Fractional, s: Any, spans: Any = None) -> ComplexArray:
    """M(s), shape (..., n+m, n+m)."""
    s = np.asarray(s, dtype=complex)
    n, m = system.B2.shape
    matrix = np.empty((*s.shape, n + m, n + m), dtype=complex)
    matrix[..., :n, :n] = -system.A
    matrix[..., :n, n:] = -system.B2
    matrix[..., range(n), range(n)] += s[..., None]
    if m:
        lower = np.hstack([system.C2, system.D22])
        matrix[..., n:, :] = -channel_values(system, s, spans)[..., None] * lower
        matrix[..., range(n, n + m), range(n, n + m)] += channel_scale(system, s, spans)
    return matrix


def bordered_derivative(system: Fractional, s: Any, spans: Any = None) -> ComplexArray:
    """dM/ds, shape (..., n+m, n+m), of the same scaled rows."""
    s = np.asarray(s, dtype=complex)
    n, m = system.B2.shape
    matrix = np.zeros((*s.shape, n + m, n + m), dtype=complex)
    matrix[..., range(n), range(n)] = 1.0
    if m:
        spans = own_spans(system) if spans is None else spans
        lower = np.hstack([system.C2, system.D22])
        matrix[..., n:, :] = -_channel_derivatives(system, s, spans)[..., None] * lower
        slope = np.where((s.real < 0)[..., None], spans * channel_scale(system, s, spans), 0.0)
        matrix[..., range(n, n + m), range(n, n + m)] += slope
    return matrix


def solved(matrix: ComplexArray, right: ComplexArray) -> ComplexArray:
    """matrix \\ right over stacks; all inf where one matrix of the stack is singular (s is a pole)."""
    try:
        return np.asarray(np.linalg.solve(matrix, right), dtype=complex)
    except np.linalg.LinAlgError:
        return _solved_one_by_one(matrix, right)


def _solved_one_by_one(matrix: ComplexArray, right: ComplexArray) -> ComplexArray:
    answer = np.full((*matrix.shape[:-1], right.shape[-1]), np.inf, dtype=complex)
    for index in np.ndindex(matrix.shape[:-2]):
        try:
            answer[index] = np.linalg.solve(matrix[index], right[index])
        except np.linalg.LinAlgError:
            continue
    return answer


def _channel_derivatives(system: Fractional, s: ComplexArray, spans: Any) -> ComplexArray:
    """d/ds of what `channel_values` gives; shape (..., m)."""
    x, left = _arguments(system, s, spans)
    values = np.empty_like(x)
    for i, channel in enumerate(system.channels):
        values[..., i] = _piecewise(channel.kappa_derivative, x[..., i], left)
    values *= spans
    return values


def _arguments(system: Fractional, s: Any, spans: Any) -> tuple[ComplexArray, NDArray[np.bool_]]:
    s = np.asarray(s, dtype=complex)
    spans = own_spans(system) if spans is None else spans
    return s[..., None] * spans, s.real < 0


def _piecewise(function: Any, x: ComplexArray, left: NDArray[np.bool_]) -> ComplexArray:
    """The plain function where Re s >= 0, the scaled one elsewhere."""
    values = np.empty_like(x)
    values[~left] = function(x[~left])
    values[left] = function(x[left], scaled=True)
    return values
