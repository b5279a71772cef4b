"""Bounded nonlinear least squares on scaled parameters, with confidence limits that allow for coloured residuals."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy import optimize
from scipy.stats import t as student

from delaytools.signals.parameter import Parameter
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["Estimate", "effective_number", "estimate"]

RealArray = NDArray[np.float64]
Residual = Callable[[RealArray], RealArray]
_AT_END = 1e-6  # of a parameter's scale: nearer to a bound than this counts as on it
_INSIDE = 1e-9  # of a value: how far inside its bounds a search begins


@final
@dataclass(frozen=True, eq=False)
class Estimate:
    """The outcome of a fit.

    parameters: value and std of each, in the order given; std NaN where fixed or on a bound, inf where the data say
    nothing of it. correlation (n,n) of the free ones, NaN elsewhere. residuals (m,), jacobian (m,n) ∂r/∂x, 0 where
    fixed. cost: Σ r²/2. freedom: effective
    number of residuals less the parameters fitted. success, and in words why the search ended.
    """

    parameters: tuple[Parameter, ...]
    correlation: RealArray
    residuals: RealArray
    cost: float
    freedom: float
    at_boundary: tuple[str, ...]
    success: bool
    words: str
    jacobian: RealArray

    def __getitem__(self, path: str) -> Parameter:
        for parameter in self.parameters:
            if parameter.path == path:
                return parameter
        raise DelaytoolsError("not a fitted parameter", found=repr(path), known=[p.path for p in self.parameters])

    @property
    def std(self) -> dict[str, float]:
        """Standard deviation by path."""
        return {parameter.path: parameter.std for parameter in self.parameters}

    def limits(self, path: str, confidence: float = 0.95) -> tuple[float, float]:
        """value ± t(confidence, freedom) std, by Student's distribution."""
        found = self[path]
        reach = float(student.ppf(0.5 + confidence / 2, max(self.freedom, 1.0))) * found.std
        return found.value - reach, found.value + reach


def estimate(
    residual: Residual,
    start: Sequence[Parameter],
    *,
    jacobian: Residual | None = None,
    coloured: bool = True,
    tolerance: float = 1e-12,
    evaluations: int | None = None,
    enough: Callable[[], bool] | None = None,
) -> Estimate:
    """The parameters that make Σ residual(x)² least, from `start`, within their bounds.

    residual: x (n,) in the parameters' units -> r (m,). jacobian: x -> (m,n), else central differences.
    std² = s² (n/n_eff) (JᵀJ)⁻¹, s² = Σ r²/(m - n); coloured: n_eff = m/(1 + 2 Σ ρ_k), else m.
    The search ends where the cost, the parameters or the gradient change by less than `tolerance` (relative), after
    `evaluations` of the residual, or after the first step at whose end `enough()` is true (then without success).
    A parameter on its bound counts as known in the limits of the others, and is named in `at_boundary`.
    Raises DelaytoolsError where there are fewer residuals than parameters, or none is finite at the start.
    """
    free = [i for i, parameter in enumerate(start) if not parameter.fixed]
    base = np.array([parameter.value for parameter in start], dtype=float)
    scale = np.array([_scale(parameter) for parameter in start])

    def whole(z: RealArray) -> RealArray:
        x = base.copy()
        x[free] = z * scale[free]
        return x

    def scaled_jacobian(z: RealArray) -> RealArray:
        assert jacobian is not None
        return np.asarray(jacobian(whole(z)))[:, free] * scale[free]

    def stop(_: object) -> None:
        if enough is not None and enough():
            raise StopIteration

    bounds = tuple(np.array([getattr(p, name) for p in start])[free] / scale[free] for name in ("low", "high"))
    begin = _just_inside(base[free] / scale[free], *bounds)
    _check(residual(whole(begin)), len(free))
    found = optimize.least_squares(
        lambda z: residual(whole(z)), begin, bounds=bounds,
        jac=scaled_jacobian if jacobian is not None else "3-point", xtol=tolerance, ftol=tolerance, gtol=tolerance,
        max_nfev=evaluations, callback=stop,
    )  # fmt: skip
    inside = np.minimum(found.x - bounds[0], bounds[1] - found.x) > _AT_END
    spread = _spread(found.jac, found.fun, inside, coloured)
    return _record(start, whole(found.x), (free, scale, inside), found, spread)


def effective_number(residuals: RealArray) -> float:
    """n/(1 + 2 Σ ρ_k) of a series (n,), the sum up to the first pair of lags whose ρ is not positive; at most n.

    Pairs of neighbouring lags: Geyer's initial positive sequence (1992), which keeps noise out of the sum.
    """
    n = len(residuals)
    r = residuals - np.mean(residuals)
    power = np.abs(np.fft.rfft(r, 2 * n)) ** 2
    covariance = np.fft.irfft(power)[: max(n // 2, 2)]
    if covariance[0] <= 0:
        return float(n)
    rho = covariance[1:] / covariance[0]
    pairs = rho[: len(rho) // 2 * 2].reshape(-1, 2).sum(axis=1)
    stop = int(np.argmax(pairs <= 0)) if np.any(pairs <= 0) else len(pairs)
    return float(n / max(1.0, 1 + 2 * pairs[:stop].sum()))


def _just_inside(z: RealArray, low: RealArray, high: RealArray) -> RealArray:
    """Values strictly between their bounds, where the search takes its first step: no value is evaluated twice."""
    room = np.minimum(_INSIDE * np.maximum(1.0, np.abs(z)), 0.5 * (high - low))
    return np.clip(z, low + room, high - room)


def _scale(parameter: Parameter) -> float:
    """What one unit of the scaled parameter is: the value, or a thousandth of the range, or 1."""
    span = parameter.high - parameter.low
    found = max(abs(parameter.value), 1e-3 * span if math.isfinite(span) else 0.0)
    return found if found > 0 else 1.0


def _check(residuals: RealArray, count: int) -> None:
    if len(residuals) <= count:
        raise DelaytoolsError(
            "too few residuals for so many parameters", found=f"{len(residuals)} for {count}", advice="use more rows"
        )
    if not np.all(np.isfinite(residuals)):
        raise DelaytoolsError(
            "the residuals are not finite where the search starts",
            found=f"{int(np.sum(~np.isfinite(residuals)))} of {len(residuals)}",
            advice="start elsewhere, or look for gaps in the data",
        )


def _spread(J: RealArray, r: RealArray, inside: NDArray[np.bool_], coloured: bool) -> tuple[RealArray, float]:
    """Covariance of the scaled free parameters inside their bounds, and the degrees of freedom."""
    n = effective_number(r) if coloured else float(len(r))
    count = int(inside.sum())
    variance = float(r @ r) / (len(r) - count) * len(r) / n
    _, sigma, vt = np.linalg.svd(J[:, inside], full_matrices=False)
    kept = sigma > 1e-12 * sigma.max(initial=0.0)
    covariance = variance * (vt[kept].T / sigma[kept] ** 2) @ vt[kept]
    lost = np.abs(vt[~kept]).max(axis=0, initial=0.0) > 1e-6
    covariance[lost, lost] = np.inf
    return covariance, max(n - count, 1.0)


def _record(
    start: Sequence[Parameter],
    x: RealArray,
    sets: tuple[list[int], RealArray, NDArray[np.bool_]],
    found: optimize.OptimizeResult,
    spread: tuple[RealArray, float],
) -> Estimate:
    free, scale, inside = sets
    places = np.array(free, dtype=int)[inside]
    std, correlation = np.full(len(start), np.nan), np.full((len(start), len(start)), np.nan)
    root = np.sqrt(np.diag(spread[0]))
    std[places] = root * scale[places]
    with np.errstate(invalid="ignore"):
        correlation[np.ix_(places, places)] = spread[0] / np.outer(root, root)
    ends = [start[i].path for i, within in zip(free, inside, strict=True) if not within]
    x = x.copy()
    for i in (i for i, within in zip(free, inside, strict=True) if not within):
        x[i] = min(start[i].low, start[i].high, key=lambda end, at=float(x[i]): abs(end - at))
    parameters = tuple(
        replace(p, value=float(np.clip(value, p.low, p.high)), std=float(s))
        for p, value, s in zip(start, x, std, strict=True)
    )
    jacobian = np.zeros((len(found.fun), len(start)))
    jacobian[:, free] = found.jac / scale[free]
    words = found.message.replace("`", "").strip(". ")
    if ends:
        words += f"; on a bound: {', '.join(ends)}"
    return Estimate(
        parameters, correlation, np.asarray(found.fun), float(found.cost), spread[1], tuple(ends),
        bool(found.success), words, jacobian,
    )  # fmt: skip
