"""Certified roots for 200 delays of a rate loop, against tdcpy in the same run: equal sets first, then time."""

from logging import CRITICAL, getLogger
from time import perf_counter

import control as ct
import numpy as np
import pytest
from scipy.linalg import matrix_balance

from delaytools.analysis.characteristic_roots import roots_over_delays
from delaytools.linear.algebra import delay, feedback

tdcpy = pytest.importorskip("tdcpy")
getLogger("tdcpy").setLevel(CRITICAL)

K, LINE = 50.0, -200.0
DELAYS = np.linspace(0.001, 0.030, 200)
AXIS = ct.tf([180.0**2], [1, 2 * 0.6 * 180, 180.0**2]) * ct.tf([377.0**2], [1, 2 * 0.6 * 377, 377.0**2])
LOOP = feedback(K * AXIS * ct.tf([1], [1, 0]) * delay(0.015))


def by_delaytools():
    return roots_over_delays(LOOP, None, DELAYS, right_of=LINE)


def by_tdcpy():
    return [_tdcpy_roots(tau) for tau in DELAYS]


def _tdcpy_roots(tau):
    """In balanced coordinates: in others tdcpy drops some of these roots, since its Newton does not converge."""
    return tdcpy.roots(tdcpy.RDDE(A=list(BALANCED), hA=[0.0, tau]), r=LINE)[0]


def _balanced(A, delayed):
    _, (scale, _) = matrix_balance(np.abs(A) + np.abs(delayed), permute=False, separate=True)
    return A / scale[:, None] * scale, delayed / scale[:, None] * scale


def _seconds(function):
    start = perf_counter()
    function()
    return perf_counter() - start


BALANCED = _balanced(LOOP.A, LOOP.B2 @ LOOP.C2)


def test_two_hundred_delays_ten_times_faster_than_tdcpy():
    ours, theirs = by_delaytools(), by_tdcpy()
    assert all(answer.certified for answer in ours)
    for answer, other in zip(ours, theirs, strict=True):
        assert len(answer.roots) == len(other)
        gap = np.abs(answer.roots[:, None] - other[None, :]).min(axis=1)
        assert np.all(gap < 1e-9 * np.abs(answer.roots))
    fast = min(_seconds(by_delaytools) for _ in range(3))
    slow = min(_seconds(by_tdcpy) for _ in range(2))
    print(f"200 delays, certified: {fast:.3f} s; tdcpy: {slow:.3f} s; ratio {slow / fast:.1f}")
    assert slow / fast >= 10
