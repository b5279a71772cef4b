"""All balances of a loop with nonlinear pieces: a net over amplitude and frequency, then each one to rounding."""

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.describing_functions import POINTS, Sines, first_harmonics
from delaytools.analysis.frequency_net import PER_DECADE
from delaytools.analysis.harmonic_balance import Balance, Oscillation, polished

__all__ = ["balanced_oscillations"]

RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_SIZES = np.geomspace(1e-9, 1e9, 18 * 32 + 1)
_PROPORTIONAL = 0.003  # a piece is linear where its answer grows with the size by the power 1 within this
_SIZES_PER_DECADE = 20
_WIDE_NET = (6, 16)  # sizes and frequencies per decade where pieces have several arguments together
_MOST = 12  # balances kept, those of the lowest frequencies
_SWEEPS = 6
_NEWTON_STEPS = 12
_SAME = 1e-5
_BESIDE_OTHERS = 1e3  # what a piece sends back to itself, against what comes from others, while it still matters
_FAINT = 1e-4  # of the largest gain behind the first turn of phase: fainter ones carry nothing that lasts


def balanced_oscillations(balance: Balance) -> tuple[Oscillation, ...]:
    """Every first-harmonic balance that a net finds, each argument in turn taken as the one that says the size.

    A cycle keeps at least one piece busy where it is not linear: with that piece's argument as the reference, the sizes
    to look at are those where it is not.
    """
    found: list[Oscillation] = []
    for reference in range(len(balance.arguments)):
        with np.errstate(all="ignore"):  # what is not finite on the net is no start
            starts = _starts(balance, reference, balance.net)
        if balance.is_slow and not balance.lopsided:
            nearly = (polished(balance, start, reference, rough=True) for start in starts)
            starts = _distinct([one for one in nearly if one is not None])
        answers = (polished(balance, start, reference) for start in starts)
        found = _distinct([*found, *(one for one in answers if one is not None)])
    return tuple(sorted(found, key=lambda one: one.s.imag)[:_MOST])


def _distinct(found: list[Oscillation]) -> list[Oscillation]:
    kept: list[Oscillation] = []
    for one in found:
        if not any(_same(one, other) for other in kept):
            kept.append(one)
    return kept


def _same(one: Oscillation, other: Oscillation) -> bool:
    near = abs(one.s - other.s) < _SAME * abs(one.s)
    sizes, others = np.abs(one.amplitude), np.abs(other.amplitude)
    return bool(near and np.all(np.abs(sizes - others) <= 10 * _SAME * (sizes + others).max()))


def _starts(balance: Balance, reference: int, omega: RealArray) -> list[Oscillation]:
    """Corners of the net's cells in which the balance of the reference changes sign in size and in phase.

    Those of the larger size: a limit just below it says nothing of the size yet at the other ones.
    """
    alone = len(balance.arguments) == 1
    if not alone:
        omega = omega[:: max(1, round(PER_DECADE / _WIDE_NET[1]))]
    reached = balance.reached(1j * omega)
    good = np.isfinite(reached).all(axis=(1, 2))
    omega, reached = omega[good], reached[good]
    sizes, omega, reached = _worth_looking(balance, reference, omega, reached)
    if sizes.size < 2 or omega.size < 2:
        return []
    amplitude = _others(balance, reference, sizes, omega, reached)
    grid = (len(sizes), len(omega))
    first = balance.roughly_made(amplitude, np.tile(omega, len(sizes)))
    back = np.einsum("nr,rn->n", np.tile(reached[:, reference, :], (len(sizes), 1)), first).reshape(grid)
    cells = _cells(np.log(back / sizes[:, None]))
    nothing = np.zeros(len(amplitude))
    return [Oscillation(nothing, amplitude[:, (i + 1) * len(omega) + j], 1j * omega[j]) for i, j in cells]


def _worth_looking(
    balance: Balance, reference: int, omega: RealArray, reached: ComplexArray
) -> tuple[RealArray, RealArray, ComplexArray]:
    """The sizes at which the reference's piece is not linear, and the frequencies at which something can come back."""
    place = next(i for i, (own, _) in enumerate(balance.places) if own.start <= reference < own.stop)
    part, (own, results) = balance.parts[place], balance.places[place]
    middle = float(np.sqrt(omega[0] * omega[-1]))
    alone = np.zeros((len(part.arguments), _SIZES.size), dtype=complex)
    alone[reference - own.start] = _SIZES
    together = np.tile(_SIZES + 0j, (len(part.arguments), 1))
    gains, bent = np.zeros(_SIZES.size), np.zeros(_SIZES.size, dtype=bool)
    for amplitude in (alone, together):
        answer = _answers(balance, place, amplitude, middle)
        power = np.gradient(np.log(answer), np.log(_SIZES))
        bent |= ~(np.abs(power - 1) < _PROPORTIONAL) & (answer > 0)
        gains = np.maximum(gains, answer / _SIZES)
    if not bent.any():
        return np.zeros(0), omega, reached
    back = np.linalg.norm(reached[:, reference, results], axis=1)
    if not back.any():  # nothing of what it does comes back to it straight: whatever it does goes round by others
        back = np.linalg.norm(reached[:, reference, :], axis=1)
    heard = back > _FAINT * _after_first_turn(omega, reached[:, reference, results], back)
    one = len(balance.arguments) == 1
    low, high = _bounds(gains[bent], _SIZES[bent], back[heard], 2.0 if one else _BESIDE_OTHERS)
    per_decade = _SIZES_PER_DECADE if one else _WIDE_NET[0]
    sizes = np.geomspace(low / 2, high * 2, max(8, int(per_decade * np.log10(4 * high / low))))
    return sizes, omega[heard], reached[heard]


def _answers(balance: Balance, place: int, amplitude: ComplexArray, omega: float) -> RealArray:
    sines = Sines(np.zeros(amplitude.shape), amplitude, np.full(amplitude.shape[1], omega))
    return np.abs(first_harmonics(balance.parts[place], sines, POINTS)[1]).max(axis=0)


def _bounds(gains: RealArray, sizes: RealArray, back: RealArray, room: float) -> tuple[float, float]:
    """The least and the largest size worth a look: what comes back is about as large (within `room`) somewhere."""
    able = (gains * back.max() * room > 1) & (gains * back.min() < room)
    sizes = sizes[able] if able.any() else sizes
    return float(sizes.min()), float(sizes.max())


def _after_first_turn(omega: RealArray, reached: ComplexArray, back: RealArray) -> float:
    """The largest gain where the phase has turned once, or of all frequencies where it does not."""
    column = reached[:, int(np.argmax(np.abs(reached).max(axis=0)))]
    turned = np.flatnonzero(np.diff(np.signbit(column.imag)))
    return float(back[turned[0] :].max()) if turned.size else float(back.max())


def _cells(ratio: ComplexArray) -> list[tuple[int, int]]:
    corners = np.stack([ratio[:-1, :-1], ratio[1:, :-1], ratio[:-1, 1:], ratio[1:, 1:]])
    size, phase = corners.real, corners.imag
    nothing = np.isneginf(size)  # inside a dead band: nothing comes back, which has no phase
    phase = np.where(nothing & ~nothing.all(axis=0), np.where(nothing, -np.inf, phase).max(axis=0), phase)
    crossed = (size.min(axis=0) <= 0) & (size.max(axis=0) >= 0)
    crossed &= (phase.min(axis=0) <= 0) & (phase.max(axis=0) >= 0) & (np.ptp(phase, axis=0) < np.pi)
    return [(int(i), int(j)) for i, j in np.argwhere(crossed)]


def _others(
    balance: Balance, reference: int, sizes: RealArray, omega: RealArray, reached: ComplexArray
) -> ComplexArray:
    """(k, sizes x frequencies) amplitudes of all arguments while the reference has its size: swept, then Newton's."""
    k = len(balance.arguments)
    at = np.tile(omega, len(sizes))
    amplitude = np.zeros((k, at.size), dtype=complex)
    amplitude[reference] = np.repeat(sizes, len(omega))
    if k == 1:
        return amplitude
    G = np.tile(reached, (len(sizes), 1, 1))
    for _ in range(_SWEEPS):
        amplitude = _kept(np.einsum("nkr,rn->kn", G, balance.roughly_made(amplitude, at)), amplitude, reference)
    return _newton(balance, reference, amplitude, (at, G))


def _kept(new: ComplexArray, old: ComplexArray, reference: int) -> ComplexArray:
    new[reference] = old[reference]
    return np.where(np.isfinite(new), new, 0.0)


def _newton(
    balance: Balance, reference: int, amplitude: ComplexArray, driven: tuple[RealArray, ComplexArray]
) -> ComplexArray:
    """The other amplitudes where the sweeps did not settle: Newton's steps in real and imaginary parts, all at once."""
    omega, G = driven
    others = [k for k in range(len(amplitude)) if k != reference]

    def missing(chosen: NDArray[np.intp], now: ComplexArray) -> ComplexArray:
        made = balance.roughly_made(now, omega[chosen])
        return (np.einsum("nkr,rn->kn", G[chosen], made) - now)[others]

    open_ = np.arange(omega.size)
    for _ in range(_NEWTON_STEPS):
        now = amplitude[:, open_]
        left = missing(open_, now)
        size = np.abs(now).max(axis=0)
        going = np.abs(left).max(axis=0) > 1e-4 * size
        open_, now, left, size = open_[going], now[:, going], left[:, going], size[going]
        if not open_.size:
            break
        slopes = np.empty((open_.size, 2 * len(others), 2 * len(others)))
        for column, (k, unit) in enumerate([(k, unit) for unit in (1.0, 1j) for k in others]):
            moved = now.copy()
            moved[k] += 1e-5 * unit * size
            change = (missing(open_, moved) - left) / (1e-5 * size)
            slopes[:, :, column] = np.concatenate([change.real, change.imag]).T
        slopes += 1e-12 * np.eye(2 * len(others))
        step = np.linalg.solve(slopes, -np.concatenate([left.real, left.imag]).T[..., None])[..., 0].T
        step = step[: len(others)] + 1j * step[len(others) :]
        limit = np.minimum(1.0, size / np.maximum(np.abs(step).max(axis=0), 1e-300))
        amplitude[np.ix_(others, open_)] = now[others] + step * limit
    if open_.size:
        amplitude[:, open_] = np.nan
    return amplitude
