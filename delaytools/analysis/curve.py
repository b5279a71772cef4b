"""The frequency response as a curve: points close enough together that nothing happens unseen between them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals

from delaytools.linear.channel import Hold
from delaytools.linear.delay_system import DelaySystem

__all__ = ["FLOOR", "Curve", "Features", "features_of", "traced"]

RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FLOOR = 0.01  # below this |L| a crossing is not listed, and only the first ones are looked for
_POINTS_PER_DECADE = 24
_MOST_POINTS = 100_000
_FARTHEST = 1e6  # delays shorter than a millionth of the fastest time constant are not followed to their turn
_BEND = 0.06  # log |L| and phase may leave the chord by this much at the middle of a segment
_TURN = 0.8  # and the phase may turn by this much along half a segment, rad


@final
@dataclass(frozen=True, eq=False)
class Features:
    """Where a response may bend: its delay-free poles and zeros (rad/s), spans of delay, its ends.

    at_zero: L(0), nan where 0 is a pole. at_infinity: L(∞) where it exists, else nan; ceiling: limsup |L(jω)|.
    """

    points: ComplexArray
    spans: tuple[float, ...]
    at_zero: float
    at_infinity: float
    ceiling: float


@final
@dataclass(frozen=True, eq=False)
class Curve:
    """L(jω) at rising ω (n,) in rad/s > 0; `gap` marks the segments across a pole on the axis.

    top: π/T of a sampled response, its last frequency; None for a continuous one.
    """

    response: Callable[[RealArray], ComplexArray]
    features: Features
    omega: RealArray
    value: ComplexArray
    gap: NDArray[np.bool_]
    top: float | None = None

    @cached_property
    def phase(self) -> RealArray:
        """arg L(jω) in rad, continuous along the curve outside the gaps."""
        return np.unwrap(np.angle(self.value))

    @cached_property
    def size(self) -> RealArray:
        """The larger |L| at the two ends of each segment (n-1,)."""
        return np.maximum(np.abs(self.value[:-1]), np.abs(self.value[1:]))


def features_of(L: DelaySystem) -> Features:
    """Poles with the delays closed at zero and cut open, zeros, and both ends of L (one input, one output)."""
    loop = np.eye(L.n_channels) - L.D22
    poles = [eigvals(L.A)]
    if L.n_channels and np.linalg.cond(loop) < 1e12:
        wired = np.linalg.solve(loop, np.hstack([L.C2, L.D21]))
        inner, into = wired[:, : L.n_states], wired[:, L.n_states :]
        parts = (L.A + L.B2 @ inner, L.B1 + L.B2 @ into, L.C1 + L.D12 @ inner, L.D11 + L.D12 @ into)
        poles.append(eigvals(parts[0]))
    else:
        parts = (L.A, L.B1, L.C1, L.D11)
    points = np.concatenate([*poles, _zeros(*parts)])
    spans = tuple(span for span in L.delays if span > 0)
    infinity, ceiling = _at_infinity(L)
    return Features(points[np.isfinite(points)], spans, _at_zero(L, poles[-1]), infinity, ceiling)


def _zeros(A: RealArray, B: RealArray, C: RealArray, D: RealArray) -> ComplexArray:
    """The finite generalised eigenvalues of [[A, B], [C, D]] against diag(I, 0)."""
    n = A.shape[0]
    size = n + B.shape[1]
    with np.errstate(all="ignore"):
        found = eigvals(np.block([[A, B], [C, D]]), np.diag([1.0] * n + [0.0] * (size - n)))
    largest = 1e6 * max(1e-300, float(np.abs(A).max(initial=0.0)))
    return found[np.isfinite(found) & (np.abs(found) < largest)]


def _at_zero(L: DelaySystem, poles: ComplexArray) -> float:
    scale = np.abs(poles).max(initial=0.0)
    if np.any(np.abs(poles) <= 1e-12 * scale) or (poles.size and scale == 0.0):
        return float("nan")
    value = complex(L.siso(0.0))
    return float(value.real) if np.isfinite(value) else float("nan")


def _at_infinity(L: DelaySystem) -> tuple[float, float]:
    """L(∞), nan where the delays leave no limit, and limsup |L|; holds let nothing pass."""
    passing = [i for i, channel in enumerate(L.channels) if not isinstance(channel, Hold)]
    out, into = L.D12[0, passing], L.D21[passing, 0]
    inner, direct = L.D22[np.ix_(passing, passing)], float(L.D11[0, 0])
    if not out.any() or not into.any():
        return direct, abs(direct)
    if not inner.any() and not (out * into).any():
        return direct, abs(direct)
    return float("nan"), _largest_at_infinity(direct, out, into, inner)


def _largest_at_infinity(direct: float, out: RealArray, into: RealArray, inner: RealArray) -> float:
    """max |D11 + D12 Δ (I - D22 Δ)⁻¹ D21| over Δ = diag(e^{jθ}), the delays taken as independent."""
    if not inner.any():
        return abs(direct) + float(np.abs(out * into).sum())
    theta = np.random.default_rng(0).uniform(0, 2 * np.pi, (4096, len(out)))
    theta[0], theta[1] = 0.0, np.pi
    delta = np.exp(1j * theta)
    size = np.eye(len(out))
    right = np.broadcast_to(into[:, None].astype(complex), (len(theta), len(out), 1))
    solved = np.linalg.solve(size - inner * delta[:, None, :], right)[..., 0]
    return float(np.abs(direct + (out * delta * solved).sum(axis=1)).max())


def traced(
    response: Callable[[RealArray], ComplexArray],
    features: Features,
    *,
    extra: RealArray | None = None,
    top: float | None = None,
) -> Curve:
    """The curve of `response`: ω -> L(jω), resolved for itself and for `extra` series delays in s.

    Points: a logarithmic grid around all poles and zeros, clusters at the lightly damped ones, a linear grid
    where delay turns the phase, then segments are halved until log L is nearly straight on each.
    top: the last frequency (π/T of a sampled response); without it the curve goes on until |L| is below
    the floor and each delay has had its turn.
    """
    extra = np.zeros(0) if extra is None else extra[extra > 0]
    low, high = _range(features, extra, top)
    omega = np.concatenate([_logarithmic(low, high), _clusters(features.points, low, high)])
    omega = np.unique(omega)
    value = response(omega)
    last = _last_above(omega, np.abs(value))
    turning = sum(features.spans) + float(extra.max(initial=0.0))
    if turning > 0:
        fine = np.arange(0.5 / turning, min(high, last * 1.05), 0.5 / turning)[:_MOST_POINTS]
        omega, value = _joined(omega, value, fine, response)
        omega, value = _within_tail(omega, value, last, features)
    omega, value = _straightened(omega, value, response, features)
    return Curve(response, features, omega, value, _gaps(omega, features.points), top)


def _range(features: Features, extra: RealArray, top: float | None) -> tuple[float, float]:
    sizes = np.abs(features.points)
    known = sizes[sizes > 1e-9 * sizes.max(initial=0.0)] if sizes.size else sizes
    spans = np.array([*features.spans, *extra])
    spans = spans[spans > 1e-300]
    scales = np.concatenate([known, 1.0 / spans])
    if top is not None:
        return 1e-4 * min(top, scales.min(initial=top)), top
    if not scales.size:
        return 1e-3, 1e3
    largest = float(known.max(initial=0.0)) or float(scales.min())
    high = max(1e2 * largest, 20.0 * min(float(scales.max()), _FARTHEST * largest))
    return 1e-3 * float(scales.min()), high


def _logarithmic(low: float, high: float) -> RealArray:
    return np.geomspace(low, high, max(64, int(_POINTS_PER_DECADE * np.log10(high / low))))


def _clusters(points: ComplexArray, low: float, high: float) -> RealArray:
    """Points around each pole and zero near the axis, denser the lighter its damping."""
    found = [np.zeros(0)]
    for point in points[points.imag > 0]:
        width = max(abs(point.real), 1e-9 * abs(point))
        steps = width * np.geomspace(
            0.25, max(0.5, 0.4 * abs(point) / width), 3 + 5 * _decades(abs(point) / width)
        )
        on_axis = abs(point.real) <= 1e-9 * abs(point)
        centre = np.zeros(0) if on_axis else np.array([point.imag])
        found.append(np.concatenate([point.imag - steps, centre, point.imag + steps]))
    near = np.concatenate(found)
    return near[(near > low) & (near < high)]


def _decades(ratio: float) -> int:
    return int(np.ceil(np.log10(max(ratio, 1.0)))) + 1


def _last_above(omega: RealArray, size: RealArray) -> float:
    above = np.flatnonzero(size >= 0.3 * FLOOR)
    return float(omega[above[-1]]) if above.size else float(omega[0])


def _joined(
    omega: RealArray, value: ComplexArray, more: RealArray, response: Callable[[RealArray], ComplexArray]
) -> tuple[RealArray, ComplexArray]:
    more = np.setdiff1d(more, omega)
    if not more.size:
        return omega, value
    omega, value = np.concatenate([omega, more]), np.concatenate([value, response(more)])
    order = np.argsort(omega, kind="stable")
    return omega[order], value[order]


def _within_tail(
    omega: RealArray, value: ComplexArray, last: float, features: Features
) -> tuple[RealArray, ComplexArray]:
    """Without the far tail, where the delays inside L would have to be followed turn by turn for nothing."""
    if not features.spans:
        return omega, value
    sizes = np.abs(features.points)
    end = max(last, float(sizes.max(initial=0.0))) * 1.5 + 4.5 * np.pi / min(features.spans)
    keep = omega <= max(end, omega[min(8, len(omega) - 1)])
    return omega[keep], value[keep]


def _straightened(
    omega: RealArray, value: ComplexArray, response: Callable[[RealArray], ComplexArray], features: Features
) -> tuple[RealArray, ComplexArray]:
    """Segments halved until the middle of each lies near the chord of log L."""
    fresh = ~_gaps(omega, features.points)
    for _ in range(12):
        start = np.flatnonzero(fresh)
        if not start.size or len(omega) > _MOST_POINTS:
            break
        middle = np.sqrt(omega[start] * omega[start + 1])
        at = response(middle)
        with np.errstate(all="ignore"):
            first, second = np.log(at / value[start]), np.log(value[start + 1] / at)
        bent = ~(np.abs(first - second) < 2 * _BEND) | (
            np.maximum(np.abs(first.imag), np.abs(second.imag)) > _TURN
        )
        bent &= omega[start + 1] - omega[start] > 1e-11 * omega[start]
        omega, value = (
            np.insert(omega, start[bent] + 1, middle[bent]),
            np.insert(value, start[bent] + 1, at[bent]),
        )
        fresh = np.zeros(len(omega) - 1, dtype=bool)
        where = start[bent] + np.arange(bent.sum())
        fresh[where] = fresh[where + 1] = True
    return omega, value


def _gaps(omega: RealArray, points: ComplexArray) -> NDArray[np.bool_]:
    """The segments that hold a pole or zero on the axis itself."""
    gap = np.zeros(max(0, len(omega) - 1), dtype=bool)
    for point in points[(points.imag > 0) & (np.abs(points.real) <= 1e-9 * np.abs(points))]:
        place = np.searchsorted(omega, point.imag) - 1
        if 0 <= place < len(gap):
            gap[place] = True
    return gap
