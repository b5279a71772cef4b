"""Limit cycles of a relay with a linear loop and delays around it, exactly."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar

from delaytools.linear.channel import Delay
from delaytools.linear.delay_system import DelaySystem

__all__ = ["RelayCycle", "relay_cycles"]

RealArray = NDArray[np.float64]

_PER_DECADE = 80
_GRID = 400  # instants of a half period
_SAME = 1e-13  # of a half period: steps that differ by less are one


@final
@dataclass(frozen=True)
class RelayCycle:
    """frequency: Hz; amplitude: the largest value of what enters the relay, in its unit."""

    frequency: float
    amplitude: float


def relay_cycles(
    G: DelaySystem, level: float, half_width: float, hertz: tuple[float, float]
) -> tuple[RelayCycle, ...] | None:
    """The symmetric limit cycles between two frequencies of u = ±level, e = G u, switching at e = ±half_width.

    Over a half period P with u = level from t = 0 on, x(P) = -x(0); the relay switches at 0 where e(0⁻) = half_width
    while e rises, and not again before P (Tsypkin, Relay Control Systems, 1984, ch. 4). Exact for rational parts with
    delays between them; None where delays lie in loops of their own, or a channel is a hold.
    """
    paths = _paths(G)
    if paths is None:
        return None

    def at_switch(half: float) -> float:
        return float(_entering(paths, level, half, np.array([half]))[0]) + half_width  # e(P⁻) = -e(0⁻)

    halves = np.geomspace(0.5 / hertz[1], 0.5 / hertz[0], max(32, int(_PER_DECADE * np.log10(hertz[1] / hertz[0]))))
    values = np.array([at_switch(half) for half in halves])
    found = []
    for i in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
        half = float(brentq(at_switch, halves[i], halves[i + 1], xtol=1e-15 * halves[i], rtol=1e-14))
        if _switches_once(paths, level, half_width, half):
            found.append(RelayCycle(0.5 / half, _largest(paths, level, half)))
    return tuple(reversed(found))


@final
@dataclass(frozen=True, eq=False)
class _Path:
    """e^{-s late} (C (sI - A)^-1 B + D), one input, one output."""

    A: RealArray
    B: RealArray
    C: RealArray
    D: float
    late: float


def _paths(G: DelaySystem) -> tuple[_Path, ...] | None:
    """G as a sum of delayed rational parts; None where a channel feeds a channel or is no delay."""
    if not all(isinstance(channel, Delay) for channel in G.channels) or G.D22.any():
        return None
    powers = [np.eye(G.n_states)]
    for _ in range(G.n_states - 1):
        powers.append(G.A @ powers[-1])
    if any(np.any(G.C2 @ power @ G.B2) for power in powers if G.n_states):
        return None
    n = G.n_states
    found = [_Path(G.A, G.B1[:, 0], G.C1[0], float(G.D11[0, 0]), 0.0)]
    for i, channel in enumerate(G.channels):
        A = np.block([[G.A, np.zeros((n, n))], [np.outer(G.B2[:, i], G.C2[i]), G.A]])
        B = np.concatenate([G.B1[:, 0], G.B2[:, i] * G.D21[i, 0]])
        C = np.concatenate([G.D12[0, i] * G.C2[i], G.C1[0]])
        found.append(_Path(A, B, C, float(G.D12[0, i] * G.D21[i, 0]), channel.span))
    return tuple(found)


def _entering(paths: tuple[_Path, ...], level: float, half: float, t: RealArray) -> RealArray:
    """e at the times t (s) in (0, half], u = level in (0, half], from the left where it jumps."""
    return sum((_answer(path, level, half, t - path.late) for path in paths), np.zeros(len(t)))


def _answer(path: _Path, level: float, half: float, t: RealArray) -> RealArray:
    """The steady answer of a rational part to the square wave, at times of any half period."""
    turns = np.ceil(t / half - 1e-12) - 1  # so that t = half belongs to the half period that ends there
    sign = np.where(turns % 2 == 0, 1.0, -1.0)
    inside = t - turns * half
    n = len(path.B)
    if n == 0:
        return sign * path.D * level
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = path.A, path.B * level
    over = expm(whole * half)
    begin = -np.linalg.solve(np.eye(n) + over[:n, :n], over[:n, n])
    states = _along(whole, np.append(begin, 1.0), inside, _SAME * half)[:, :n]
    return sign * (states @ path.C + path.D * level)


def _along(whole: RealArray, begin: RealArray, times: RealArray, same: float) -> RealArray:
    """(times, n): z(t) of z' = whole z, from time to time; steps that differ by less than `same` (s) are one."""
    moves: dict[int, RealArray] = {}
    found, z, last = np.empty((len(times), len(begin))), begin, 0.0
    for place in np.argsort(times):
        key = round((times[place] - last) / same)
        if key not in moves:
            moves[key] = expm(whole * (times[place] - last))
        z, last = moves[key] @ z, times[place]
        found[place] = z
    return found


def _switches_once(paths: tuple[_Path, ...], level: float, half_width: float, half: float) -> bool:
    """Whether e rises where the relay switches up, and stays above -half_width until the half period ends."""
    t = half * np.linspace(1.0 / _GRID, 1.0, _GRID)
    e = _entering(paths, level, half, t)
    falling = e[-1] < e[-2]
    return bool(falling and np.all(e[:-1] > -half_width - 1e-9 * np.abs(e).max()))


def _largest(paths: tuple[_Path, ...], level: float, half: float) -> float:
    kinks = [float(np.mod(path.late, half)) for path in paths]
    t = np.unique(np.concatenate([half * np.linspace(0.0, 1.0, _GRID)[1:], [k for k in kinks if k > 0]]))
    e = np.abs(_entering(paths, level, half, t))
    best = int(np.argmax(e))
    low, high = t[max(best - 1, 0)], t[min(best + 1, len(t) - 1)]
    found = minimize_scalar(lambda x: -abs(_entering(paths, level, half, np.array([x]))[0]), bounds=(low, high),
                            method="bounded", options={"xatol": 1e-12 * half})  # fmt: skip
    return max(float(e[best]), -float(found.fun))
