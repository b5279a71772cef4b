"""200 delays: the exact sweep against python-control's stability_margins with 10th-order Padé, same run."""

from time import perf_counter

import control
import numpy as np
import pytest

from delaytools.analysis.delay_sweep import sweep_margins
from delaytools.linear.delay_system import as_delay_system

PLANT = control.tf([3 * 14050.0], np.polymul([1.0, 17.86, 14050.0], [0.5, 1.0]))
DELAYS = np.linspace(0.05e-3, 50e-3, 200)


def with_pade() -> np.ndarray:
    """Gain margin, phase margin (deg) and modulus margin for each delay, by the Padé polynomials' roots."""
    return np.array(
        [control.stability_margins(PLANT * control.tf(*control.pade(tau, 10)))[:3] for tau in DELAYS]
    )


def exact() -> np.ndarray:
    """The same figures (and more) from the sweep, records built for each delay."""
    found = sweep_margins(as_delay_system(PLANT), DELAYS).margins
    return np.array([(m.gain_margin, np.degrees(m.phase_margin), m.modulus_margin) for m in found])


def columns() -> np.ndarray:
    """The sweep's arrays alone, as stability_margins gives bare figures."""
    return sweep_margins(as_delay_system(PLANT), DELAYS).table.gain_margin


def test_exact_sweep_is_20_times_faster(capsys: pytest.CaptureFixture[str]) -> None:
    fast, slow = exact(), with_pade()
    valid = DELAYS * 121.0 > 0.5  # at smaller delays the Padé polynomials' coefficients span too many decades
    assert np.max(np.abs(fast[valid, :2] / slow[valid, :2] - 1)) < 1e-6
    assert np.max(np.abs(fast[valid, 2] / slow[valid, 2] - 1)) < 1e-4
    durations = {}
    for name, run in (("columns", columns), ("exact", exact), ("pade", with_pade)):
        times = []
        for _ in range(2 if name == "pade" else 7):
            start = perf_counter()
            run()
            times.append(perf_counter() - start)
        durations[name] = min(times)
    ratio = durations["pade"] / durations["exact"]
    with capsys.disabled():
        print(f"\n{len(DELAYS)} delays: exact {1e3 * durations['exact']:.1f} ms (without the records "
              f"{1e3 * durations['columns']:.1f} ms), Padé 10 {1e3 * durations['pade']:.0f} ms, "
              f"ratio {ratio:.0f} ({durations['pade'] / durations['columns']:.0f})")  # fmt: skip
    assert ratio >= 20
