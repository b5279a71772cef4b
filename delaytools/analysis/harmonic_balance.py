"""The first-harmonic balance of a loop: a linear rest with exact delay, nonlinear pieces by describing functions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import root

from delaytools.analysis.describing_functions import Sines, first_harmonics, gain_table, harmonics
from delaytools.analysis.frequency_net import frequency_net
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.hold_approximation import continuous_approximation
from delaytools.linear.sampled_system import SampledSystem
from delaytools.loop.linearise import formulas, linearise
from delaytools.loop.loop import Loop
from delaytools.loop.nonlinear_parts import NonlinearPart, parted

__all__ = ["FINE", "Balance", "Oscillation", "balance_of", "carried_on", "polished", "with_delay"]

RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Table = Callable[[RealArray, RealArray], ComplexArray]

FINE = 16384  # points of a period for an answer
_FEWER, _NEAR = 512, 0.03  # points with which an answer is approached, and what may be left then
_ROUGH = 32  # points of a period where a net is searched and a piece has several arguments
_TRIES = 25  # evaluations for each unknown
_AWAY = 1.5  # in the logarithms of frequency and amplitude: an answer further from its start belongs to another one
_HARMONICS = range(2, 12)


@final
@dataclass(frozen=True, eq=False)
class Oscillation:
    """A balance that was found: arguments of the pieces = mean + Re(amplitude e^{st}).

    mean, amplitude: (k,). s: rad/s, on the axis for a limit cycle.
    """

    mean: RealArray
    amplitude: ComplexArray
    s: complex


@final
@dataclass(frozen=True, eq=False)
class Balance:
    """arguments = G(s) results + rest at zero, results = what the pieces make of them; signals likewise.

    system: results -> (arguments, signals), delays exact, holds as (1 - e^{-sT})/(sT). still: the sampled linear rest;
    offsets: what stands in its rows [x'; z; q; y] at zero.
    """

    parts: tuple[NonlinearPart, ...]
    system: DelaySystem
    still: SampledSystem
    offsets: RealArray
    signals: tuple[str, ...]
    without: tuple[str, ...]
    _kept: dict[str, tuple[Table | None, ...]] = field(default_factory=dict, repr=False)  # for all delays

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the arguments of all pieces."""
        return tuple(name for part in self.parts for name in part.arguments)

    @property
    def places(self) -> tuple[tuple[slice, slice], ...]:
        """Where the arguments and the results of each piece stand."""
        found, a, r = [], 0, 0
        for part in self.parts:
            found.append((slice(a, a + len(part.arguments)), slice(r, r + len(part.results))))
            a, r = a + len(part.arguments), r + len(part.results)
        return tuple(found)

    def made(self, sines: Sines, points: int) -> tuple[RealArray, ComplexArray]:
        """Mean and first harmonic of all results, (r, N), for arguments (k, N)."""
        pairs = [
            first_harmonics(part, Sines(sines.mean[own], sines.amplitude[own], sines.omega), points)
            for part, (own, _) in zip(self.parts, self.places, strict=True)
        ]
        return np.concatenate([mean for mean, _ in pairs]), np.concatenate([first for _, first in pairs])

    @property
    def _tables(self) -> tuple[Table | None, ...]:
        if "tables" not in self._kept:
            self._kept["tables"] = tuple(gain_table(part, self.net) for part in self.parts)
        return self._kept["tables"]

    @cached_property
    def net(self) -> RealArray:
        """The frequencies (n,), rad/s, among which balances are sought."""
        return frequency_net(self.system)

    def roughly_made(self, amplitude: ComplexArray, omega: RealArray) -> ComplexArray:
        """First harmonic of all results, (r, N), for a search: no means, from tables where a piece has one argument."""
        found = []
        for part, (own, _), table in zip(self.parts, self.places, self._tables, strict=True):
            some = amplitude[own]
            if table is not None:
                found.append(table(np.abs(some[0]), omega) * some)
            else:
                found.append(first_harmonics(part, Sines(np.zeros(some.shape), some, omega), _ROUGH)[1])
        return np.concatenate(found)

    def reached(self, s: ComplexArray) -> ComplexArray:
        """G(s) from results to arguments, (N, k, r)."""
        return self.system(s)[..., : len(self.arguments), :]

    @cached_property
    def lopsided(self) -> bool:
        """Whether means have to be balanced too: something is not zero at rest, or a piece is not odd."""
        if np.any(np.abs(self.offsets) > 0):
            return True
        generator = np.random.default_rng(0)
        sizes = np.geomspace(1e-4, 1e4, 17)
        k = len(self.arguments)
        turned = np.exp(2j * np.pi * generator.uniform(size=(k, 1)))
        mean, first = self.made(Sines(np.zeros((k, 17)), sizes * turned, np.full(17, 30.0)), 256)
        return bool(np.any(np.abs(mean) > 1e-3 * np.abs(first).max(initial=1e-300)))

    @property
    def is_slow(self) -> bool:
        """Whether a piece has to be followed for turns to be known."""
        return any(part.times != (0.0, 0.0) for part in self.parts)

    def missing_mean(self, mean: RealArray, rest: RealArray, made: RealArray) -> RealArray:
        """What is left of the balance of means; rest: (x, v, w) of the still system, made: means of the results."""
        s = self.still
        M, n, nw = s.M, s.n_states, s.n_transports
        rows = M[:, : len(rest)] @ rest + M[:, len(rest) :] @ made + self.offsets
        v, w = rest[n : n + s.n_sampled_outputs], rest[n + s.n_sampled_outputs :]
        q = rows[n + nw : n + nw + s.n_sampled_inputs]
        gain = block_diag(*(one.steady_gain for one in s.samplers)) if s.samplers else np.zeros((0, 0))
        arguments = rows[len(rows) - len(s.outputs) :][: len(self.arguments)]
        return np.concatenate([rows[:n], rows[n : n + nw] - w, gain @ q - v, arguments - mean])

    def results_of(self, found: Oscillation) -> ComplexArray:
        """First harmonics (r,) of what the pieces give in an oscillation."""
        sines = Sines(found.mean[:, None], found.amplitude[:, None], np.array([found.s.imag]))
        return self.made(sines, FINE)[1][:, 0]

    def distortion(self, found: Oscillation) -> float:
        """Root of the sum of squares of harmonics 2 to 11 at the argument that they spoil most, over its first one."""
        sines = Sines(found.mean[:, None], found.amplitude[:, None], np.array([found.s.imag]))
        lines = np.concatenate(
            [harmonics(part, Sines(sines.mean[own], sines.amplitude[own], sines.omega), _HARMONICS, FINE)[..., 0].T
             for part, (own, _) in zip(self.parts, self.places, strict=True)]
        )  # fmt: skip
        reached = self.reached(1j * found.s.imag * np.array(list(_HARMONICS)))
        carried = np.einsum("nkr,rn->kn", reached, lines)
        size = np.abs(found.amplitude)
        moving = size > 1e-6 * size.max()
        return float((np.linalg.norm(carried, axis=1)[moving] / size[moving]).max())


def balance_of(loop: Loop, signals: Sequence[str]) -> Balance:
    """The balance of a loop with all external inputs at zero, which also tells the amplitude of some signals."""
    pieces = parted(loop)
    arguments = [name for part in pieces.parts for name in part.arguments]
    results = [name for part in pieces.parts for name in part.results]
    found = linearise(pieces.rest, results, [*arguments, *signals])
    lines = formulas(pieces.rest, [*arguments, *signals])
    at = ca.DM.zeros(lines.symbols.all.shape[0])
    offsets = np.asarray(ca.Function("at", [lines.symbols.all], [lines.rows])(at)).ravel()
    whole = continuous_approximation(found.system)
    return Balance(pieces.parts, whole, found.system, offsets, tuple(signals), found.without)


def with_delay(balance: Balance, transport: int, seconds: float) -> Balance:
    """The balance with another delay (s) of one transport of the rest."""
    delays = list(balance.still.delays)
    delays[transport] = seconds
    still = replace(balance.still, delays=tuple(delays))
    return replace(balance, still=still, system=continuous_approximation(still))


def polished(balance: Balance, start: Oscillation, reference: int, *, rough: bool = False) -> Oscillation | None:
    """The limit cycle near a start: s on the axis, the argument `reference` with phase 0; None where none is reached.

    Unknown: ln ω, ln of that amplitude, the other amplitudes in its units, and means where there are any. rough: by
    the tables of a search.
    """
    return _solved(balance, start, reference, None, rough)


def carried_on(balance: Balance, start: Oscillation, reference: int, size: float) -> Oscillation | None:
    """The quasi-linear root near a cycle at another amplitude of the reference: s has a real part there."""
    return _solved(balance, start, reference, size)


def _solved(
    balance: Balance, start: Oscillation, reference: int, size: float | None, rough: bool = False
) -> Oscillation | None:
    """The balance from a start, with the reference's amplitude free on the axis, or given with s free."""
    x = _Unknown(balance, start, reference, size, 0).start()
    for points, enough in ((0, 1e-6),) if rough else ((_FEWER, _NEAR), (FINE, 1e-6)):
        unknown = _Unknown(balance, start, reference, size, points)
        with np.errstate(all="ignore"):
            options = {"xtol": 1e-13, "maxfev": _TRIES * (len(x) + 1)}
            x = root(unknown.left_over, x, method="hybr", options=options).x
            left = unknown.left_over(x)
        if not (np.all(np.isfinite(left)) and np.abs(left).max() < enough and np.abs(x[:2]).max() < _AWAY):
            return None
    return unknown.oscillation(x)


@final
@dataclass(frozen=True, eq=False)
class _Unknown:
    """The unknowns of a balance as one vector, without units: (2 of s and the reference, others, rest, means).

    points: of a period; 0: by the tables of a search.
    """

    balance: Balance
    near: Oscillation
    reference: int
    size: float | None
    points: int

    @property
    def others(self) -> list[int]:
        return [k for k in range(len(self.near.amplitude)) if k != self.reference]

    def start(self) -> RealArray:
        scaled = self.near.amplitude / self.near.amplitude[self.reference]
        others = scaled[self.others]
        head = np.zeros(2)
        if self.size is not None:
            head[1] = self.near.s.real / abs(self.near.s)
        rest = np.zeros(self._rest_count)
        means = self.near.mean / self._scale if self.balance.lopsided else np.zeros(0)
        return np.concatenate([head, others.real, others.imag, rest, means])

    @property
    def _scale(self) -> float:
        return float(abs(self.near.amplitude[self.reference]))

    @property
    def _rest_count(self) -> int:
        s = self.balance.still
        return s.n_states + s.n_sampled_outputs + s.n_transports if self.balance.lopsided else 0

    def oscillation(self, x: RealArray) -> Oscillation:
        k, others = len(self.near.amplitude), self.others
        count = len(others)
        first, second = np.clip(np.nan_to_num(x[:2]), -2 * _AWAY, 2 * _AWAY)
        turn = self.near.s.imag * np.exp(first)
        size = self._scale * np.exp(second) if self.size is None else self.size
        s = 1j * turn if self.size is None else complex(second * abs(self.near.s), turn)
        amplitude = np.empty(k, dtype=complex)
        amplitude[self.reference] = size
        amplitude[others] = size * (x[2 : 2 + count] + 1j * x[2 + count : 2 + 2 * count])
        mean = self._scale * x[len(x) - k :] if self.balance.lopsided else np.zeros(k)
        return Oscillation(mean, amplitude, s)

    def left_over(self, x: RealArray) -> RealArray:
        found = self.oscillation(x)
        sines = Sines(found.mean[:, None], found.amplitude[:, None], np.array([found.s.imag]))
        if not self.points:
            mean, first = np.zeros((0, 1)), self.balance.roughly_made(sines.amplitude, sines.omega)
        else:
            mean, first = self.balance.made(sines, self.points)
        size = abs(found.amplitude[self.reference])  # as it is now: nothing at all is no oscillation
        left = (self.balance.reached(np.array([found.s]))[0] @ first[:, 0] - found.amplitude) / size
        parts = [left.real, left.imag]
        if self.balance.lopsided:
            at = 2 + 2 * len(self.others)
            rest = self._scale * x[at : at + self._rest_count]
            parts.append(self.balance.missing_mean(found.mean, rest, mean[:, 0]) / size)
        return np.concatenate(parts)
