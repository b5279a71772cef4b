"""Sinusoidal describing functions: the mean and the first harmonic of what a nonlinear piece makes of sines."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from delaytools.blocks.backlash import Backlash
from delaytools.blocks.dead_band import DeadBand
from delaytools.blocks.quantizer import Quantizer
from delaytools.blocks.rate_limiter import RateLimiter
from delaytools.blocks.relay import Relay
from delaytools.blocks.saturation import Saturation
from delaytools.loop.nonlinear_parts import NonlinearPart

__all__ = ["POINTS", "Sines", "closed_form", "first_harmonics", "gain_table", "harmonics"]

RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

POINTS = 1024  # of one period: what jumps at a phase of its own is 1/POINTS of a turn off at most
_AT_ONCE = 2_000_000  # values of a formula
_TURNS = 3  # periods after which a memory repeats that has no time of its own
_SETTLED, _MOST_TURNS = 8.0, 40  # own times after which another one repeats, and periods at most
_MOST_POINTS = 16384
_MANY_STEPS = 1000  # steps of a quantiser in an amplitude, beyond which its gain is 1 within 1e-4
_MEMORY_POINTS = 512  # of a period along which a memory is followed
_OF_MOVING = (6, 8)  # speeds and frequencies per decade
_TABLE_POINTS = 256
_TABLE = np.geomspace(1e-12, 1e12, 24 * 96 + 1)
_FULL = 2.0 / np.hypot(np.pi, 2.0)  # limit / (A ω) below which a slew limit never catches up with the sine


@final
@dataclass(frozen=True, eq=False)
class Sines:
    """What enters a piece: mean (k, N), amplitude (k, N) complex, u = mean + Re(amplitude e^{jωt}), ω (N,) rad/s."""

    mean: RealArray
    amplitude: ComplexArray
    omega: RealArray

    def at(self, chosen: Any) -> "Sines":
        """The same arguments at some of the N points."""
        return Sines(self.mean[:, chosen], self.amplitude[:, chosen], self.omega[chosen])


def first_harmonics(
    part: NonlinearPart, sines: Sines, points: int = POINTS, *, closed: bool = True
) -> tuple[RealArray, ComplexArray]:
    """(mean (r, N), first harmonic (r, N) complex) of the results of a piece; closed: by formula where one is known.

    Numerically over one period, the argument's own phase taken out where there is one alone, so that nothing depends
    on where the points lie. Source of the formulas: Gelb & Vander Velde, Multiple-Input Describing Functions (1968),
    appendix B.
    """
    alone = len(part.arguments) == 1
    formula = closed_form(part) if closed and not np.any(sines.mean) else None
    if formula is not None:
        size = np.abs(sines.amplitude[0])
        gain = np.zeros(size.shape, dtype=complex)
        some = size > 0
        gain[some] = formula(size[some], sines.omega[some])
        return np.zeros((1, size.size)), (gain * sines.amplitude[0])[None, :]
    turn = np.exp(1j * np.angle(sines.amplitude[0])) if alone else np.ones(sines.omega.shape)
    lines = harmonics(part, Sines(sines.mean, sines.amplitude / turn, sines.omega), (0, 1), points)
    return np.real(lines[0]) / 2.0, lines[1] * turn


def harmonics(part: NonlinearPart, sines: Sines, orders: Sequence[int], points: int = POINTS) -> ComplexArray:
    """(orders, r, N): y = Re(lines[0] / 2 + Σ lines[n] e^{jnωt}), by sums over one period once a memory has settled."""
    if part.memory:
        return _remembered_lines(part, sines, orders)
    turning = _turning(points, orders)
    count = max(1, _AT_ONCE // points)
    pieces = [sines.at(slice(k, k + count)) for k in range(0, sines.omega.size, count)]
    return np.moveaxis(np.concatenate([_instant(part, piece, points) @ turning for piece in pieces], axis=1), -1, 0)


def _turning(points: int, orders: Sequence[int]) -> ComplexArray:
    return np.exp(-1j * np.outer(_angles(points), np.asarray(orders))) * (2.0 / points)


def _remembered_lines(part: NonlinearPart, sines: Sines, orders: Sequence[int]) -> ComplexArray:
    """Of a piece with memory, frequency by frequency: each takes steps and turns of its own."""
    found = np.empty((len(orders), len(part.results), sines.omega.size), dtype=complex)
    for omega in np.unique(sines.omega):
        here = np.flatnonzero(sines.omega == omega)
        shortest, longest = part.times
        points = _MEMORY_POINTS
        if shortest > 0:
            points = int(np.clip(2 * np.pi / omega / shortest, points, _MOST_POINTS))
        turns = int(np.clip(1 + _SETTLED * longest * omega / (2 * np.pi), 2, _MOST_TURNS)) if longest > 0 else _TURNS
        waves = _remembered(part, sines.at(here), points, turns)
        found[:, :, here] = np.moveaxis(waves @ _turning(points, orders), -1, 0)
    return found


def gain_table(part: NonlinearPart, omega: RealArray) -> Callable[[RealArray, RealArray], ComplexArray] | None:
    """(amplitude, ω) -> gains (r, N) of a piece of one argument, for a search: about 1e-3 off, more beside an edge.

    omega: the frequencies, rising, among which it is asked. None for a piece of several arguments.
    """
    if len(part.arguments) != 1:
        return None
    exact = closed_form(part) if isinstance(part.block, RateLimiter) else None
    if exact is not None:
        return lambda size, at: exact(np.maximum(size, _TABLE[0]), at)[None, :]
    if part.memory and closed_form(part) is None:
        return _moving_table(part, omega)
    sines = Sines(np.zeros((1, _TABLE.size)), _TABLE[None, :] + 0j, np.ones(_TABLE.size))
    gains = first_harmonics(part, sines, _TABLE_POINTS)[1] / _TABLE
    places = np.log(_TABLE)

    def table(size: RealArray, at: RealArray) -> ComplexArray:
        where = np.log(np.maximum(size, _TABLE[0]))
        return np.stack([np.interp(where, places, row) for row in gains])

    return table


def _moving_table(part: NonlinearPart, omega: RealArray) -> Callable[[RealArray, RealArray], ComplexArray]:
    """Gains of a piece with times of its own over A ω, the speed asked of it, and ω.

    Below a hundredth of its own fastest rate the gain depends on A ω alone: what limits it there is its speed.
    """
    low = max(float(omega[0]), 0.01 / part.times[0])
    high = max(min(float(omega[-1]), 3.0 / part.times[0]), 2 * low)
    rates = np.geomspace(low, high, max(4, int(_OF_MOVING[1] * np.log10(high / low))))
    probe = _TABLE[:: _TABLE.size // 96]
    middle = np.full(probe.size, np.sqrt(rates[0] * rates[-1]))
    answer = np.abs(first_harmonics(part, Sines(np.zeros((1, probe.size)), probe[None, :] + 0j, middle))[1]).max(axis=0)
    bent = np.abs(np.gradient(np.log(np.maximum(answer, 1e-300)), np.log(probe)) - 1) > 0.01
    knee = float(probe[bent][0] * middle[0]) if bent.any() else 1.0
    speeds = knee * np.geomspace(0.1, 1e4, 5 * _OF_MOVING[0] + 1)
    size = speeds[:, None] / rates[None, :]
    sines = Sines(np.zeros((1, size.size)), size.reshape(1, -1) + 0j, np.tile(rates, len(speeds)))
    gains = (first_harmonics(part, sines)[1] / sines.amplitude).reshape(-1, *size.shape)
    places = np.log(speeds), np.log(rates)
    tables = [RegularGridInterpolator(places, gain, bounds_error=False, fill_value=None) for gain in gains]

    def table(size: RealArray, at: RealArray) -> ComplexArray:
        inside = np.clip(np.log(np.maximum(size, 1e-300) * at), places[0][0], places[0][-1])
        return np.stack([one((inside, np.clip(np.log(at), places[1][0], places[1][-1]))) for one in tables])

    return table


def _angles(points: int) -> RealArray:
    return (np.arange(points) + 0.5) * (2 * np.pi / points)


def _arguments(sines: Sines, points: int) -> RealArray:
    wave = np.exp(1j * _angles(points))
    return sines.mean[..., None] + np.real(sines.amplitude[..., None] * wave)


def _instant(part: NonlinearPart, sines: Sines, points: int) -> RealArray:
    u = _arguments(sines, points)
    given = np.ascontiguousarray(u.reshape(len(u), -1).T)
    buffer, evaluate = _at_points(part.formula, len(given)).buffer()
    found = np.empty((len(given), len(part.results)))
    buffer.set_arg(0, memoryview(given))
    buffer.set_res(0, memoryview(found))
    evaluate()
    return found.T.reshape(len(part.results), *u.shape[1:])


@lru_cache(maxsize=64)
def _at_points(formula: ca.Function, count: int) -> ca.Function:
    """A formula at so many points in one call, built once: as a call with a matrix it is built anew each time."""
    return formula.map(count)


def _remembered(part: NonlinearPart, sines: Sines, points: int, turns: int) -> RealArray:
    """A memory followed from angle to angle for some turns, the last one kept: (r, N, points)."""
    u = _arguments(sines, points)
    before = np.roll(u, 1, axis=-1)
    step = (2 * np.pi / points) / sines.omega
    turn = _turn(part.formula, points)
    found = np.empty((len(part.results), *u.shape[1:]))
    for column in range(sines.omega.size):
        # a follower begins where its argument's mean is, what has times of its own at rest
        memory = np.full(part.memory, sines.mean[0, column] if part.times == (0.0, 0.0) else 0.0)
        for _ in range(turns):
            steps, out = turn(memory, before[:, column], u[:, column], np.full((1, points), step[column]))
            memory = np.asarray(steps)[:, -1]
        found[:, column] = np.asarray(out)
    return found


@lru_cache(maxsize=64)
def _turn(formula: ca.Function, points: int) -> ca.Function:
    """A whole turn of a memory in one call."""
    return formula.mapaccum(points)


def closed_form(part: NonlinearPart) -> Callable[[RealArray, RealArray], ComplexArray] | None:
    """(amplitude > 0, ω) -> gain N of a piece that is one known block, for sines without mean; None for others."""
    block: Any = part.block
    match block:
        case DeadBand():
            return lambda size, _: 1.0 - _clipped(float(block.half_width) / size) + 0j
        case Saturation():
            return lambda size, _: _clipped(float(block.limit) / size) + 0j
        case Quantizer():
            return lambda size, _: _stepped(float(block.step), size)
        case Backlash():
            return lambda size, _: _played(float(block.half_width) / size)
        case Relay():
            return lambda size, _: _switched(float(block.level), float(block.half_width), size)
        case RateLimiter():
            return lambda size, omega: _slewed(float(block.limit), size, omega)
    return None


def _clipped(ratio: RealArray) -> RealArray:
    """Of clip(u, ±limit), ratio = limit/A."""
    r = np.minimum(ratio, 1.0)
    return (2 / np.pi) * (np.arcsin(r) + r * np.sqrt(1 - r**2))


def _stepped(step: float, size: RealArray) -> ComplexArray:
    """Of rounding to whole steps: Σ 4 step/(πA) √(1 - (k - 1/2)² step²/A²) over the edges that are reached."""
    found, few = np.ones(size.shape), size < _MANY_STEPS * step
    A = size[few]
    gain = np.zeros(A.shape)
    for k in range(1, int(A.max(initial=0.0) / step + 0.5) + 1):
        gain += (4 * step / (np.pi * A)) * np.sqrt(np.maximum(1 - ((k - 0.5) * step / A) ** 2, 0.0))
    found[few] = gain
    return found + 0j


def _played(ratio: RealArray) -> ComplexArray:
    """Of play of half width b, ratio = b/A."""
    c = np.clip(1 - 2 * ratio, -1.0, 1.0)
    real = 0.5 + (np.arcsin(c) + c * np.sqrt(1 - c**2)) / np.pi
    return np.where(ratio < 1, real - 4j / np.pi * ratio * (1 - ratio), 0.0)


def _switched(level: float, half_width: float, size: RealArray) -> ComplexArray:
    """Of a relay ±level that switches at ±half_width."""
    ratio = np.minimum(half_width / size, 1.0)
    return np.where(size > half_width, 4 * level / (np.pi * size) * (np.sqrt(1 - ratio**2) - 1j * ratio), 0.0)


def _slewed(limit: float, size: RealArray, omega: RealArray) -> ComplexArray:
    """Of a slew limit: a triangle where it never catches up with the sine, 1 where it does not bite."""
    ratio = limit / (size * omega)
    full = np.minimum(ratio, _FULL)
    found = np.where(ratio >= 1, 1.0 + 0j, (4 * full / np.pi) * np.exp(-1j * np.arccos(np.pi * full / 2)))
    between = (ratio > _FULL) & (ratio < 1)
    found[between] = _caught_up(ratio[between])
    return found


def _caught_up(ratio: RealArray) -> ComplexArray:
    """Of a slew limit that lets go of the sine and catches up with it in each half turn, ratio = limit/(A ω).

    It lets go at φ₀ with cos φ₀ = ratio behind the top of the slope and meets the sine again at φ₁:
    y = sin φ₀ + ratio (φ - φ₀) between, sin φ elsewhere; N = (2j/π) ∫ y e^{-jφ} dφ over half a turn.
    """
    lets_go = -np.arccos(ratio)
    low, high = np.arccos(ratio), np.full(ratio.shape, np.pi + 0.0) + lets_go
    for _ in range(60):  # sin φ₁ - sin φ₀ = ratio (φ₁ - φ₀): above before, below behind
        middle = 0.5 * (low + high)
        above = np.sin(middle) - np.sin(lets_go) > ratio * (middle - lets_go)
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    meets = 0.5 * (low + high)

    def straight(phi: RealArray) -> ComplexArray:  # of (sin φ₀ + ratio (φ - φ₀)) e^{-jφ}
        return np.exp(-1j * phi) * (1j * (np.sin(lets_go) + ratio * (phi - lets_go)) + ratio)

    def sine(phi: RealArray) -> ComplexArray:  # of sin φ e^{-jφ}
        return -0.5j * phi - 0.25 * np.exp(-2j * phi)

    whole = straight(meets) - straight(lets_go) + sine(lets_go + np.pi) - sine(meets)
    return (2j / np.pi) * whole
