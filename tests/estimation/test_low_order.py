"""The thesis's 14050/(s² + 17.86 s + 14050) recovered from noisy records and from a response."""

import math

import numpy as np
import pytest

from delaytools.blocks.delay import Delay
from delaytools.blocks.transfer_function import TransferFunction
from delaytools.estimation.low_order import LowOrderFit, against_delay, fit
from delaytools.estimation.low_order_frequency import loes_residual
from delaytools.estimation.second_order_response import drive, responses
from delaytools.loop.loop import Loop
from delaytools.signals.record import Record
from delaytools.signals.response import Response
from delaytools.signals.stimulus import Column
from delaytools.signals.trouble import DelaytoolsError
from delaytools.simulation.simulate import simulate
from tests.simulation.benches import element

W, ZETA = math.sqrt(14050), 17.86 / 2 / math.sqrt(14050)  # Rao 2023, eq. 3.8: 18.87 Hz, 0.0753
TRUTH = {"natural_frequency": W, "damping": ZETA, "gain": 1.0}


def record(seed: int, delay: float = 0.0, *, held: bool = False, rows: int = 1000) -> Record:
    """A chirp through the resonance, rows unevenly spaced, noise at 20 dB below the output."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(1.5e-3, 2.5e-3, rows))
    u = np.sin(2 * math.pi * (1 + 8 * t) * t) + 0.3 * rng.standard_normal(rows)
    y = responses(W, ZETA, drive(t, u, delay, held))[:, 0]
    y = y + 0.1 * np.std(y) * rng.standard_normal(rows)
    return Record(t, {"u": u, "y": y}, held=frozenset({"u"}) if held else frozenset())


def inside(found: LowOrderFit, truth: dict[str, float]) -> list[bool]:
    limits = {name: found.estimate.limits(name) for name in truth}
    return [limits[name][0] <= value <= limits[name][1] for name, value in truth.items()]


def test_limits_cover_the_truth() -> None:
    hits = np.array([inside(fit(record(seed, held=seed % 2 == 1), "u", "y"), TRUTH) for seed in range(40)])
    assert np.all(hits.mean(axis=0) >= 0.85)
    assert hits.mean() <= 1.0


def test_limits_cover_the_truth_with_a_delay() -> None:
    truth = {**TRUTH, "delay": 0.015}
    hits = np.array([inside(fit(record(seed, 0.015), "u", "y", delay=True), truth) for seed in range(20)])
    assert np.all(hits.mean(axis=0) >= 0.8)
    found = fit(record(1, 0.015), "u", "y", delay=True)
    assert found.delay == pytest.approx(0.015, abs=3e-4)
    assert found.denominator == pytest.approx((1.0, 17.86, 14050.0), rel=0.03)


@pytest.mark.parametrize("held", [False, True])
def test_a_clean_run_gives_the_coefficients(held: bool) -> None:
    """A run of the package's simulator, from rest; and rows cut from its middle, where it is in motion."""
    t = np.arange(1500) * 1e-3
    u = np.sin(2 * math.pi * (1 + 8 * t) * t)
    plant = TransferFunction(numerator=(14050.0,), denominator=(1.0, 17.86, 14050.0))
    loop = Loop((element("late", Delay(delay=0.0123), "u", "v"), element("plant", plant, "v", "y")))
    run = simulate(loop, {"u": Column(time=t, values=u, held=held)}, duration=1.499, substeps=8).record
    whole = Record(run.time, {"u": u, "y": run["y"]}, held=frozenset({"u"}) if held else frozenset())
    found = fit(whole, "u", "y", delay=True)
    assert found.denominator == pytest.approx((1.0, 17.86, 14050.0), rel=1e-4)
    assert found.delay == pytest.approx(0.0123, abs=1e-6)
    part = fit(whole.between(0.5, 1.4), "u", "y", delay=True)
    assert part.denominator == pytest.approx((1.0, 17.86, 14050.0), rel=0.02)
    assert part.delay == pytest.approx(0.0123, abs=3e-4)


def test_from_a_response() -> None:
    omega = np.geomspace(10, 300, 40)
    s = 1j * omega
    value = 14050 / (s**2 + 17.86 * s + 14050)
    plain = fit(Response(omega, value))
    assert plain.denominator == pytest.approx((1.0, 17.86, 14050.0), rel=1e-8)
    assert plain.numerator == pytest.approx((14050.0,), rel=1e-8)
    assert plain.response(omega) == pytest.approx(value, rel=1e-8)
    late = fit(Response(omega, value * np.exp(-0.015 * s)), delay=True)
    assert (late.delay, late.natural_frequency) == pytest.approx((0.015, W), rel=1e-8)


def test_from_a_response_on_even_frequencies() -> None:
    omega = np.linspace(5, 300, 800)
    s = 1j * omega
    found = fit(Response(omega, 3 * 14050 * np.exp(-0.01 * s) / (s**2 + 17.86 * s + 14050)), delay=True)
    assert found.gain == pytest.approx(3.0, rel=1e-3)
    assert found.delay == pytest.approx(0.01, rel=1e-3)


def test_cost_of_low_order_equivalence() -> None:
    """J = (20/n) Σ [ΔdB² + 0.01745 Δdeg²]: 1 dB and 2 deg off everywhere give 20 (1 + 0.0698)."""
    measured = np.exp(1j * np.linspace(0, 3, 20))
    r = loes_residual(measured * 10 ** (1 / 20) * np.exp(1j * math.radians(2)), measured)
    assert r @ r == pytest.approx(20 * (1 + 0.01745 * 4))


def test_words_keep_a_resonance_from_being_taken_for_a_delay() -> None:
    omega = np.geomspace(10, 300, 40)
    s = 1j * omega
    found = fit(Response(omega, 14050 / (s**2 + 17.86 * s + 14050)))
    assert found.low_frequency_delay == pytest.approx(17.86 / 14050)
    for piece in ("18.87 Hz", "0.0753", "stable", "1.27 ms", "resonance with peak 6.66, not a delay"):
        assert piece in found.words
    said = against_delay(found, 0.015, 9.0)
    for piece in ("not a 15 ms delay", "1.27 ms", "11.8 times less", "5.32 deg late", "48.6 deg"):
        assert piece in said


def test_faults() -> None:
    good = record(1)
    with pytest.raises(DelaytoolsError, match="no such signal"):
        fit(good, "u", "z")
    with pytest.raises(DelaytoolsError, match="never moves"):
        fit(Record(good.time, {"u": 0 * good["u"], "y": good["y"]}), "u", "y")
    with pytest.raises(DelaytoolsError, match="too few rows"):
        fit(good.rows(slice(0, 10)), "u", "y")
    with pytest.raises(DelaytoolsError, match="at least 5 rising frequencies"):
        fit(Response(np.array([1.0, 2.0]), np.array([1.0, 1.0 + 0j])))
