"""Values ahead of a quantiser that the log shows: no derivative passes its steps, but every row lies between two."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import is_added
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

    By least squares on what the signal ahead of it lies beyond the half step about each measured value.
    """
    place = next(
        (k for k, one in enumerate(fitted.added) if one.kind == KIND and case.exit_at(one.at) is not None), None
    )
    if place is None or case.is_late:
        return fitted
    one, rest = fitted.added[place], tuple(a for k, a in enumerate(fitted.added) if k != place)
    exit, known, step = case.exit_at(one.at), fitted.by_path, one.values["step"]
    start = [
        replace(p, value=known[p.path].value) if p.path in known and not is_added(p.path) else p
        for p in case.parameters(rest)
    ]
    if not start:
        return fitted
    measured = np.concatenate([rows[:, exit] for rows in case.measured])
    noise = float(np.std(measured - step * np.round(measured / step)))
    half = 0.5 * step + min(NOISE * noise, 0.5 * step)

    def off(x: Array) -> Array:
        return measured - np.concatenate([rows[:, exit] for rows in case.outputs(rest, tuple(x))])

    def beyond(x: Array) -> Array:
        rows = off(x)
        return np.asarray(rows - np.clip(rows, -half, half)) / step

    def slopes(x: Array) -> Array:
        found = [replay.run_with_derivatives(tuple(x))[1][:, exit] for replay in case.replays(rest)]
        return np.asarray(-np.concatenate(found) * (np.abs(off(x)) > half)[:, None] / step)

    found = estimate(beyond, start, jacobian=slopes, coloured=False, evaluations=EVALUATIONS)
    values = {p.path: p.value for p in found.parameters}
    near = replace(fitted, parameters=tuple(replace(p, value=values.get(p.path, p.value)) for p in fitted.parameters))
    moved = placed(rest, found.parameters)
    again = fit_hypothesis(case, (*moved[:place], one, *moved[place:]), near=near)
    return again if again.chi2 < fitted.chi2 else fitted
