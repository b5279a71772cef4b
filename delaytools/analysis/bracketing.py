"""Roots and minima of many functions at once, each kept inside its own bracket."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["Family", "Indices", "refined_minima", "refined_roots"]

RealArray = NDArray[np.float64]
Indices = NDArray[np.intp]
Family = Callable[[RealArray, Indices], RealArray]  # f(x, which): function which[i] at x[i]

_PRECISION = 4.0 * np.finfo(float).eps
_GOLDEN = 0.381966011250105


def refined_roots(family: Family, left: RealArray, right: RealArray) -> RealArray:
    """x_i in [left_i, right_i] with f_i(x_i) = 0, to 4 rounding errors of x_i; arrays (n,).

    Each bracket must hold a change of sign; where it does not, the end with the smaller |f| is given.
    Source: T. R. Chandrupatla, Adv. Eng. Software 28 (1997) 145: inverse quadratic steps, bisection otherwise
    (here the first step is the secant's).
    """
    which = np.arange(len(left))
    ends = np.array([left, right], dtype=float)
    values = np.array([family(end, which) for end in ends]) if which.size else np.zeros_like(ends)
    answer = np.where(np.abs(values[0]) <= np.abs(values[1]), ends[0], ends[1])
    open_ = np.flatnonzero(values[0] * values[1] < 0)
    a, b, c = ends[0][open_], ends[1][open_], ends[0][open_]
    fa, fb, fc = values[0][open_], values[1][open_], values[0][open_]
    step = np.clip(fa / (fa - fb), 0.02, 0.98)
    for _ in range(100):
        if not open_.size:
            break
        x = a + step * (b - a)
        fx = family(x, open_)
        same = np.sign(fx) == np.sign(fa)
        b, fb, c, fc = (
            np.where(same, b, a),
            np.where(same, fb, fa),
            np.where(same, a, b),
            np.where(same, fa, fb),
        )
        a, fa = x, fx
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        answer[open_] = best
        limit = _PRECISION * np.abs(best) / np.abs(b - c)
        go = (limit <= 0.5) & (fa != 0) & (fb != 0)
        step = np.clip(_next_step((a, b, c), (fa, fb, fc)), limit, 1 - limit)
        open_, a, b, c, fa, fb, fc, step = (part[go] for part in (open_, a, b, c, fa, fb, fc, step))
    return answer


def _next_step(x: tuple[RealArray, ...], f: tuple[RealArray, ...]) -> RealArray:
    """The inverse quadratic step as a part of [a, b], or 1/2 where Chandrupatla's test refuses it."""
    (a, b, c), (fa, fb, fc) = x, f
    with np.errstate(all="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        quadratic = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        good = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi) & np.isfinite(quadratic)
    return np.where(good, quadratic, 0.5)


def refined_minima(
    family: Family, left: RealArray, middle: RealArray, right: RealArray
) -> tuple[RealArray, RealArray]:
    """The x_i in [left_i, right_i] of least f_i, and that value; arrays (n,).

    f at `middle` must not exceed f at the ends. Parabolic steps, every fourth one a golden section, until a
    parabola gains less than 1e-15 of f: the value is then exact to rounding, x to its square root.
    """
    which = np.arange(len(left))
    x = np.array([left, middle, right], dtype=float)
    f = np.array([family(row, which) for row in x]) if which.size else np.zeros_like(x)
    best, least = x[1].copy(), f[1].copy()
    for turn in range(32):
        if not which.size:
            break
        vertex, promised = _parabolic(x, f)
        trial = _golden(x) if turn % 4 == 3 else vertex
        x, f = _narrowed(x, f, trial, family(trial, which))
        best[which], least[which] = x[1], f[1]
        go = x[2] - x[0] > 1e-9 * np.abs(x[1])
        if turn % 4 != 3:
            go &= promised > 1e-15 * np.abs(f[1])  # of the step just taken
        x, f, which = x[:, go], f[:, go], which[go]
    return best, least


def _golden(x: RealArray) -> RealArray:
    left, right = x[1] - x[0], x[2] - x[1]
    return np.where(left > right, x[1] - _GOLDEN * left, x[1] + _GOLDEN * right)


def _parabolic(x: RealArray, f: RealArray) -> tuple[RealArray, RealArray]:
    """The vertex of the parabola through the three points and the fall of f that it promises.

    Where it does not fall inside: a golden step, and inf.
    """
    with np.errstate(all="ignore"):
        low, high = (x[1] - x[0]) * (f[1] - f[2]), (x[1] - x[2]) * (f[1] - f[0])
        step = -0.5 * ((x[1] - x[0]) * low - (x[1] - x[2]) * high) / (low - high)
        curved = ((f[2] - f[1]) / (x[2] - x[1]) - (f[1] - f[0]) / (x[1] - x[0])) / (x[2] - x[0])
        vertex = x[1] + step
        good = (vertex > x[0]) & (vertex < x[2])
        promised = curved * step**2
    still = good & (np.abs(step) <= 1e-12 * np.abs(x[1]))
    trial = np.where(good & ~still, vertex, _golden(x))
    return trial, np.where(still, 0.0, np.where(good, promised, np.inf))


def _narrowed(x: RealArray, f: RealArray, trial: RealArray, value: RealArray) -> tuple[RealArray, RealArray]:
    better, before = value <= f[1], trial < x[1]
    centre, centre_f = np.where(better, trial, x[1]), np.where(better, value, f[1])
    other, other_f = np.where(better, x[1], trial), np.where(better, f[1], value)
    left_moves = before != better  # the point that is not the centre becomes the left or the right end
    low, low_f = np.where(left_moves, other, x[0]), np.where(left_moves, other_f, f[0])
    high, high_f = np.where(left_moves, x[2], other), np.where(left_moves, f[2], other_f)
    return np.array([low, centre, high]), np.array([low_f, centre_f, high_f])
