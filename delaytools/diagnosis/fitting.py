"""A hypothesis fitted to a case: effects and tolerated values together, by least squares on whitened residuals."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added, is_added, path_of
from delaytools.diagnosis.case import Case
from delaytools.estimation.least_squares import estimate
from delaytools.signals.parameter import Parameter

__all__ = ["STEPS", "TOLERANCE", "Fitted", "at_values", "fit_hypothesis", "has_odd_rows", "placed"]

Array = NDArray[np.float64]
TOLERANCE = 1e-7
ROUGH = 1e-5
STOPPED = 1e-3  # of the range between its bounds, from either: there a value is taken to be stopped
STEPS = 24  # evaluations of a fit
REMEMBERED = 3  # of them, beside the last


@final
@dataclass(frozen=True, eq=False)
class Fitted:
    """The best of one hypothesis.

    added: effects with fitted values. parameters: everything that was free, with std. residual (rows,) whitened and
    jacobian (rows, free) ∂residual/∂value, at the best values. is_settled: whether the fit came to its end.
    """

    added: tuple[Added, ...]
    parameters: tuple[Parameter, ...]
    residual: Array
    jacobian: Array
    is_settled: bool = True

    @property
    def chi2(self) -> float:
        """Σ of the squared whitened residuals."""
        with np.errstate(over="ignore"):  # a run that ran away
            return float(self.residual @ self.residual)

    @property
    def inside(self) -> NDArray[np.bool_]:
        """(free,) whether a value is inside its bounds: one that is stopped, or nearly, imitates nothing further."""
        ends = [min(p.value - p.low, p.high - p.value) for p in self.parameters]
        spans = [p.high - p.low if np.isfinite(p.high - p.low) else 0.0 for p in self.parameters]
        return np.array([end > STOPPED * span for end, span in zip(ends, spans, strict=True)], dtype=bool)

    @property
    def falling(self) -> float:
        """χ² that one more step would take off, were the residual linear in the values."""
        slopes = self.jacobian[:, self.inside]
        norms = np.linalg.norm(slopes, axis=0)
        basis = np.linalg.qr(slopes[:, norms > 0] / norms[norms > 0])[0]
        return float(np.sum((basis.T @ self.residual) ** 2))

    @property
    def values(self) -> tuple[float, ...]:
        """The fitted values, in the order of `parameters`."""
        return tuple(p.value for p in self.parameters)

    @property
    def size(self) -> int:
        """How many values the effects brought, those found another way than by the fit included."""
        return sum(len(one.values) for one in self.added)

    @property
    def by_path(self) -> Mapping[str, Parameter]:
        """The parameters by path."""
        return {p.path: p for p in self.parameters}


def fit_hypothesis(
    case: Case,
    added: tuple[Added, ...],
    *,
    near: Fitted | None = None,
    tolerance: float = TOLERANCE,
    evaluations: int = STEPS,
) -> Fitted:
    """The hypothesis with its values where Σ residual² is least; `near` gives starts for tolerated values.

    tolerance: of χ² and values, relative; where it is wide, delays are taken between those whose runs are kept.
    evaluations: runs at most; after the case's deadline those of one step, none where `near` is the same hypothesis.
    """
    nearly = tolerance >= ROUGH
    known = near.by_path if near else {}
    start = [
        Parameter(p.path, _inside(known[p.path].value, p), low=p.low, high=p.high)
        if p.path in known and not is_added(p.path)
        else p
        for p in case.parameters(added)
    ]
    if not start:
        return at_values(case, added, Fitted(added, (), np.zeros(0), np.zeros((0, 0))))
    if case.is_late and near is not None and near.added == added and [p.path for p in start] == list(known):
        rows = _evaluated(case, added, tuple(p.value for p in start))
        return Fitted(added, tuple(replace(p, std=known[p.path].std) for p in start), *rows, is_settled=False)
    both = _Remembered(lambda key: _evaluated(case, added, key, nearly))

    def residual(x: Array) -> Array:
        if nearly or tuple(x) in both.known:
            return both(x)[0]
        rows = case.residual(case.outputs(added, tuple(x)))
        return case.without_odd_rows(rows) if has_odd_rows(case, added) else rows

    found = estimate(
        residual, start, jacobian=lambda x: both(x)[1], coloured=False, tolerance=tolerance,
        evaluations=evaluations, enough=lambda: case.is_late,
    )  # fmt: skip
    rows = both(np.array([p.value for p in found.parameters]))
    parameters = _with_ends_open(_as_told(case, added, found.parameters, rows), *rows)
    return Fitted(placed(added, parameters), parameters, *rows, found.success)


@final
@dataclass(frozen=True, eq=False)
class _Remembered:
    """Residual and derivatives at values; the last few are kept, and the best: where a step begins, or all ends."""

    evaluate: Callable[[tuple[float, ...]], tuple[Array, Array]]
    known: dict[tuple[float, ...], tuple[Array, Array]] = field(default_factory=dict)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        key = tuple(x)
        if key not in self.known:
            if len(self.known) > REMEMBERED:
                with np.errstate(over="ignore"):  # a run that ran away
                    best = min(self.known, key=lambda one: float(self.known[one][0] @ self.known[one][0]))
                for one in self.known.keys() - {best}:
                    del self.known[one]
            self.known[key] = self.evaluate(key)
        return self.known[key]


def _as_told(
    case: Case, added: tuple[Added, ...], parameters: tuple[Parameter, ...], rows: tuple[Array, Array]
) -> tuple[Parameter, ...]:
    """The parameters with the standard errors that rows of an exit behind a quantiser allow.

    Derivatives pass its steps as if there were none; a row says less of what is ahead of it, by an error of the
    rounding beside the noise.
    """
    residual, slopes = rows
    sure = [k for k, p in enumerate(parameters) if np.isfinite(p.std) and p.std > 0]
    weights = np.ones(len(residual))
    for one in added:
        exit = case.exit_at(one.at) if one.kind == "quantization" else None
        if exit is not None:
            noise = case.whitening[exit].rms
            weights[case.rows.exit == exit] = noise / np.hypot(noise, one.values["step"] / np.sqrt(12.0))
    if not sure or weights.min() == 1.0:
        return parameters
    columns = slopes[:, sure] * weights[:, None]
    norms = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    scale = float(residual @ residual) / max(len(residual) - len(sure), 1)
    errors = np.sqrt(scale * np.diag(np.linalg.pinv((columns / norms).T @ (columns / norms)))) / norms
    found = list(parameters)
    for k, error in zip(sure, errors, strict=True):
        found[k] = replace(parameters[k], std=max(float(error), parameters[k].std))
    return tuple(found)


def _with_ends_open(parameters: tuple[Parameter, ...], residual: Array, slopes: Array) -> tuple[Parameter, ...]:
    """The parameters with standard errors that allow for values on the end of their tolerance, or of what was searched.

    Such a value is not known: it may lie anywhere within its bounds that the logs leave open, and moves the others. An
    effect's own value is as open as it would be without the bound.
    """
    shown = np.any(slopes != 0, axis=0)
    open_ended = [not p.fixed and np.isnan(p.std) for p in parameters]
    ends = [k for k, p in enumerate(parameters) if open_ended[k] and (shown[k] or not is_added(p.path))]
    inside = [k for k, p in enumerate(parameters) if np.isfinite(p.std) and p.std > 0]
    if not ends or not inside:
        return parameters
    scale = float(residual @ residual) / max(len(residual) - len(inside), 1)
    move, *_ = np.linalg.lstsq(slopes[:, inside], slopes[:, ends], rcond=None)  # (inside, ends)
    alone = slopes[:, ends] - slopes[:, inside] @ move
    spread = np.array([(parameters[k].high - parameters[k].low) / np.sqrt(3) for k in ends])
    open_by = np.minimum(np.sqrt(scale) / np.maximum(np.linalg.norm(alone, axis=0), 1e-300), spread)
    errors = np.sqrt(np.sum((move * open_by) ** 2, axis=1))
    found = list(parameters)
    for k, error in zip(inside, errors, strict=True):
        found[k] = replace(parameters[k], std=float(np.hypot(parameters[k].std, error)))
    for k, error in zip(ends, open_by, strict=True):
        found[k] = replace(parameters[k], std=float(error)) if is_added(parameters[k].path) else found[k]
    return tuple(found)


def at_values(case: Case, added: tuple[Added, ...], near: Fitted) -> Fitted:
    """The hypothesis at the values of another one that knows them all, nothing fitted."""
    known = near.by_path
    parameters = tuple(replace(p, value=known[p.path].value) for p in case.parameters(added))
    values = tuple(p.value for p in parameters)
    if not values:
        residual = case.residual(case.outputs(added, ()))
        residual = case.without_odd_rows(residual) if has_odd_rows(case, added) else residual
        return Fitted(added, (), residual, np.zeros((len(residual), 0)))
    return Fitted(added, parameters, *_evaluated(case, added, values))


def has_odd_rows(case: Case, added: tuple[Added, ...]) -> bool:
    """Whether a few rows may be off by far more than noise and mean nothing: where an effect makes a row jump as a
    whole, noise moves it by all of that, and where an input jumps between two rows nobody knows when."""
    return case.is_driven_by_jumps or any(one.kind == "quantization" for one in added)


def _evaluated(
    case: Case, added: tuple[Added, ...], values: tuple[float, ...], nearly: bool = False
) -> tuple[Array, Array]:
    """Whitened residual and its derivatives; odd rows that a jump explains cut, and still."""
    whole, slopes = case.with_derivatives(added, values, nearly=nearly)
    if not has_odd_rows(case, added):
        return whole, slopes
    cut = case.without_odd_rows(whole)
    return cut, np.where((cut == whole)[:, None], slopes, 0.0)


def _inside(value: float, bounds: Parameter) -> float:
    return float(np.clip(value, bounds.low, bounds.high))


def placed(added: tuple[Added, ...], parameters: tuple[Parameter, ...]) -> tuple[Added, ...]:
    """The effects with the values of these parameters, numbered in their order."""
    by_path = {p.path: p.value for p in parameters}
    return tuple(
        one.moved({name: by_path[path_of(k, name)] for name in one.free})
        for k, one in enumerate(added)
    )
