"""Values ahead of a quantiser that the log shows: no derivative passes its steps, but every row lies between two."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import path_of
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis, placed
from delaytools.estimation.least_squares import estimate

__all__ = ["within_steps"]

Array = NDArray[np.float64]
KIND = "quantization"
EVALUATIONS = 12
NOISE = 3.0  # standard deviations of what a rounded column shows besides its lattice


def within_steps(case: Case, fitted: Fitted) -> Fitted:
    """The hypothesis with the values ahead of a measured quantiser where the fewest rows are rounded the other way.

    Such rows are cut in a fit, and move nothing in it. Here the better one of two: by least squares on them as they
    are; and on what the signal ahead of the quantiser lies beyond the half step about each measured value.
    """
    place = next(
        (k for k, one in enumerate(fitted.added) if one.kind == KIND and case.exit_at(one.at) is not None), None
    )
    if place is None or case.is_late or not fitted.parameters:
        return fitted
    tried = [_begun_at(case, fitted, values) for values in (_uncut(case, fitted), _on_treads(case, fitted, place))]
    return min((fitted, *tried), key=lambda one: one.chi2)


def _begun_at(case: Case, fitted: Fitted, values: Mapping[str, float]) -> Fitted:
    moved = tuple(replace(p, value=values.get(p.path, p.value)) for p in fitted.parameters)
    return fit_hypothesis(case, placed(fitted.added, moved), near=replace(fitted, parameters=moved))


def _uncut(case: Case, fitted: Fitted) -> Mapping[str, float]:
    """Values by path where all rows count as they are: on average rounding hides nothing of what is ahead of it."""
    found = estimate(
        lambda x: case.residual(case.outputs(fitted.added, tuple(x))), list(fitted.parameters),
        jacobian=lambda x: case.with_derivatives(fitted.added, tuple(x))[1], coloured=False, evaluations=EVALUATIONS,
    )  # fmt: skip
    return {p.path: p.value for p in found.parameters}


def _on_treads(case: Case, fitted: Fitted, place: int) -> Mapping[str, float]:
    """Values by path of the hypothesis without the quantiser at the place, by what lies beyond half a step, and by the
    residuals of the other exits."""
    one, rest = fitted.added[place], tuple(a for k, a in enumerate(fitted.added) if k != place)
    paths = [path for path in fitted.by_path if not path.startswith(f"{path_of(place)}.")]
    start = [
        replace(p, value=fitted.by_path[path].value) for p, path in zip(case.parameters(rest), paths, strict=True)
    ]
    if not start:
        return {}
    exit, step = case.exit_at(one.at), one.values["step"]
    measured = np.concatenate([rows[:, exit] for rows in case.measured])
    noise = float(np.std(measured - step * np.round(measured / step)))
    half = np.zeros(len(case.exits))
    half[exit] = 0.5 * step + min(NOISE * noise, 0.5 * step)

    def off(x: Array) -> tuple[Array, ...]:
        return tuple(rows - y for rows, y in zip(case.measured, case.outputs(rest, tuple(x)), strict=True))

    def beyond(x: Array) -> Array:
        return case.whitened(tuple(rows - np.clip(rows, -half, half) for rows in off(x)))

    def slopes(x: Array) -> Array:
        found = [replay.run_with_derivatives(tuple(x))[1] for replay in case.replays(rest)]
        pairs = zip(found, off(x), strict=True)
        return -case.whitened(tuple(moved * (np.abs(rows) > half)[:, :, None] for moved, rows in pairs))

    found = estimate(beyond, start, jacobian=slopes, coloured=False, evaluations=EVALUATIONS)
    return {path: p.value for path, p in zip(paths, found.parameters, strict=True)}
