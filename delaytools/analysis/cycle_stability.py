"""Whether a predicted limit cycle lasts, and what each nonlinear piece does in it: roots of the quasi-linear loop."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.characteristic_roots import rightmost_roots
from delaytools.analysis.harmonic_balance import Balance, Oscillation, carried_on
from delaytools.analysis.root_newton import newton
from delaytools.linear.algebra import feedback
from delaytools.linear.delay_system import DelaySystem

__all__ = ["growth", "other_growth", "piece_gains", "root_with_gains"]

ComplexArray = NDArray[np.complex128]
_LEFT = 0.02  # of the cycle's frequency: how far left of the axis other roots are looked for
_MOVED = 1e-3  # of the amplitude, up and down


def growth(balance: Balance, cycle: Oscillation, reference: int) -> float:
    """a dσ/da in 1/s: how fast a cycle that is a little too large grows (positive: away from it, so it does not last).

    σ: real part of the quasi-linear loop's root that belongs to the cycle, at amplitude a. NaN where it is lost.
    """
    size = float(abs(cycle.amplitude[reference]))
    beside = [carried_on(balance, cycle, reference, size * (1 + sign * _MOVED)) for sign in (1.0, -1.0)]
    if beside[0] is None or beside[1] is None:
        return float("nan")
    return (beside[0].s.real - beside[1].s.real) / (2 * _MOVED)


def piece_gains(balance: Balance, cycle: Oscillation) -> tuple[ComplexArray, ...]:
    """N (r, k) of each piece in the cycle: results = N arguments for these amplitudes (the smallest such N)."""
    found = []
    made = balance.results_of(cycle)
    for own, results in balance.places:
        entering = cycle.amplitude[own]
        found.append(np.outer(made[results], entering.conj()) / max(float(np.vdot(entering, entering).real), 1e-300))
    return tuple(found)


def other_growth(balance: Balance, cycle: Oscillation, gains: Sequence[ComplexArray]) -> float:
    """The largest real part (rad/s) of the quasi-linear loop's other roots: positive where something else grows.

    -inf where none lies right of a line a little left of the axis.
    """
    found = rightmost_roots(_closed(balance, cycle, gains), right_of=-_LEFT * cycle.s.imag).roots
    others = found[np.minimum(np.abs(found - cycle.s), np.abs(found - np.conj(cycle.s))) > _LEFT * abs(cycle.s) / 2]
    return float(others.real.max(initial=-np.inf))


def root_with_gains(balance: Balance, cycle: Oscillation, gains: Sequence[ComplexArray]) -> complex:
    """The root of the quasi-linear loop that Newton's steps reach from the cycle's when pieces have other gains."""
    closed = _closed(balance, cycle, gains)
    spans = np.array(closed.delays).reshape(1, closed.n_channels)
    return complex(newton(closed, np.array([cycle.s]), spans)[0][0])


def _closed(balance: Balance, cycle: Oscillation, gains: Sequence[ComplexArray]) -> DelaySystem:
    """The rest with constant gains, right at the cycle's frequency, in place of the pieces."""
    count = len(balance.arguments)
    rest = balance.system[slice(0, count), slice(None)]
    joined = np.zeros((rest.shape[1], count), dtype=complex)
    for gain, (own, results) in zip(gains, balance.places, strict=True):
        joined[results, own] = gain
    return feedback(rest * _filter(joined, cycle.s.imag), np.eye(count), sign=1).without_zero_delays()


def _filter(gain: ComplexArray, omega: float) -> DelaySystem:
    """A real system of first order that is `gain` at jω: Re + Im - 2 Im ω/(s + ω)."""
    r, k = gain.shape
    real, imaginary = gain.real, gain.imag
    none = np.zeros((0, 0))
    return DelaySystem(
        A=-omega * np.eye(k), B1=omega * np.eye(k), B2=np.zeros((k, 0)), C1=-2 * imaginary, D11=real + imaginary,
        C2=np.zeros((0, k)), D12=np.zeros((r, 0)), D21=np.zeros((0, k)), D22=none,
    )  # fmt: skip
