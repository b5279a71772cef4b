"""How far a model's signal is from the measured one: fit, Theil's coefficient, the best time shift, noise."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from delaytools.measurement.comparison import Figures, Shift, Theil

__all__ = ["Trace", "best_shift", "counted", "cut", "figures", "fit_percent", "resolution", "rms", "theil"]

Array = NDArray[np.float64]
Trace = tuple[Array, Array, Array]  # time, measured, modelled
FARTHEST = 0.25  # s, of a time shift
PART = 0.2  # of the log's length, likewise
FLAT = 1e-12  # of a signal's size: below it, it does not move


def counted(traces: Sequence[Trace]) -> list[tuple[int, slice]]:
    """(log, rows) of the stretches that count: where the model is not NaN."""
    found = list[tuple[int, slice]]()
    for log, (_, _, model) in enumerate(traces):
        turns = np.flatnonzero(np.diff(np.r_[0, (~np.isnan(model)).astype(int), 0]))
        found += [(log, slice(int(a), int(b))) for a, b in zip(turns[::2], turns[1::2], strict=True)]
    return found


def cut(traces: Sequence[Trace]) -> list[Trace]:
    """The traces cut to the rows that count, stretch by stretch."""
    return [(t[rows], y[rows], m[rows]) for log, rows in counted(traces) for t, y, m in [traces[log]]]


def rms(values: Array) -> float:
    """√ of the mean square."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def resolution(values: Array) -> float:
    """The step of a signal that takes few values (a coarse lattice), or 0 where neighbours seldom repeat."""
    steps = np.abs(np.diff(values))
    if len(steps) < 16 or np.mean(steps == 0) < 0.3:
        return 0.0
    moving = steps[steps > 1e-9 * float(np.abs(values).max(initial=0.0))]
    return float(moving.min()) if len(moving) and len(np.unique(values)) < 0.2 * len(values) else 0.0


def fit_percent(measured: Array, modelled: Array) -> float | None:
    """100 (1 - ‖y - ŷ‖ / ‖y - ȳ‖); None where the measured signal does not move."""
    spread = float(np.linalg.norm(measured - measured.mean()))
    if spread <= FLAT * (1e-300 + float(np.linalg.norm(measured))):
        return None
    return 100.0 * (1.0 - float(np.linalg.norm(measured - modelled)) / spread)


def theil(measured: Array, modelled: Array) -> Theil:
    """Theil's coefficient and its shares (Theil 1966; Klein & Morelli 2006, section 5.6)."""
    square = float(np.mean((measured - modelled) ** 2))
    sizes = rms(measured) + rms(modelled)
    coefficient = math.sqrt(square) / sizes if sizes > 0 else None
    if square <= (FLAT * sizes) ** 2:
        return Theil(coefficient, None, None, None)
    bias = float(measured.mean() - modelled.mean()) ** 2 / square
    variance = float(measured.std() - modelled.std()) ** 2 / square
    return Theil(coefficient, bias, variance, max(0.0, 1.0 - bias - variance))


def best_shift(traces: Sequence[Trace], *, held: bool = False) -> Shift:
    """The shift τ for which ŷ(t - τ) is nearest to y(t), all logs together.

    Searched row by row within ±0.25 s or a fifth of the usual trace, then between rows on a spline through ŷ (on
    straight lines where the signal is held). Errors are rms over the rows that every shift leaves.
    """
    far = min(FARTHEST, PART * float(np.median([t[-1] - t[0] for t, _, _ in traces])))
    step = min(float(np.median(np.diff(t))) for t, _, _ in traces)
    still = all(np.ptp(model) <= FLAT * (1e-300 + np.abs(model).max()) for _, _, model in traces)
    if far < 2 * step or still:
        return Shift(None, None, None)
    coarse = _cost(traces, far, [partial(_straight, t, m) for t, _, m in traces])
    grid = step * np.arange(-int(far / step), int(far / step) + 1)
    best = float(grid[int(np.argmin([coarse(shift) for shift in grid]))])
    fine = coarse if held else _cost(traces, far, [CubicSpline(t, m) for t, _, m in traces])
    low, high = max(best - step, -far), min(best + step, far)
    found = minimize_scalar(fine, bounds=(low, high), method="bounded", options={"xatol": 1e-4 * step})
    before, after = fine(0.0), float(found.fun)
    return Shift(float(found.x) if after < before else 0.0, math.sqrt(before), math.sqrt(min(after, before)))


def _straight(rows: Array, values: Array, time: Array) -> Array:
    return np.interp(time, rows, values)


def _cost(
    traces: Sequence[Trace], far: float, curves: Sequence[Callable[[Array], Array]]
) -> Callable[[float], float]:
    inside = [(t >= t[0] + far) & (t <= t[-1] - far) for t, _, _ in traces]
    rows = [(t[keep], y[keep]) for (t, y, _), keep in zip(traces, inside, strict=True)]
    count = sum(len(t) for t, _ in rows)

    def cost(shift: float) -> float:
        total = 0.0
        for (t, y), curve in zip(rows, curves, strict=True):
            miss = y - curve(t - shift)
            total += float(miss @ miss)
        return total / count

    return cost


def figures(name: str, traces: Sequence[Trace], *, held: bool = False) -> Figures:
    """The figures of one log, or of several as one, by the rows that count."""
    traces = cut(traces)
    measured = np.concatenate([y for _, y, _ in traces])
    modelled = np.concatenate([m for _, _, m in traces])
    if not np.isfinite(modelled).all():
        none = "the model runs away: its values are no longer finite"
        return Figures(name, None, None, Theil(None, None, None, None), Shift(None, None, None),
                       {"rms_error": none, "fit_percent": none, "theil": none, "shift": none})  # fmt: skip
    fit, found, shift = (
        fit_percent(measured, modelled),
        theil(measured, modelled),
        best_shift(traces, held=held),
    )
    why = {}
    if fit is None:
        why["fit_percent"] = "the measured signal does not move"
    if found.bias is None:
        why["theil"] = (
            "there is no error to share out" if found.coefficient is not None else "both signals are zero"
        )
    if shift.seconds is None:
        why["shift"] = "the model's signal does not move, or the log is too short"
    return Figures(name, rms(measured - modelled), fit, found, shift, why)
