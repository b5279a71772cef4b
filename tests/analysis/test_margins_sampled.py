"""Exact sampled margins: the roll bench p03 and a loop in closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq

from delaytools.analysis.sampled_margins import (
    SampledLoop,
    sampled_margins,
    sampled_stable,
    sweep_sampled_margins,
)
from delaytools.linear.lifted import lift
from delaytools.linear.sampled_system import SampledSystem
from delaytools.signals.trouble import AnalysisError
from tests.analysis.sampled_benches import T, holder, roll_bench, roll_loop


def test_roll_bench() -> None:
    # computed from the practice design; delay margin confirmed by simulation (decays at 20.20, grows at 20.30 ms)
    found = sampled_margins(roll_loop(0.0))
    assert found.stable and found.sampling == "exact"
    assert found.gain_margin == pytest.approx(2.1696, abs=5e-5)
    assert found.delay_margin == pytest.approx(0.0202305, abs=5e-8)


def test_roll_bench_with_15_ms_in_place() -> None:
    found = sampled_margins(roll_loop(0.015), delay=0.015)
    assert found.delay == 0.015
    assert found.gain_margin == pytest.approx(1.1724, abs=5e-5)
    assert np.degrees(found.phase_margin) == pytest.approx(12.25, abs=5e-3)
    assert found.delay_margin == pytest.approx(0.00523, abs=5e-6)


def test_the_two_delay_margins_add_up() -> None:
    # the table's input and the writer are in series
    whole = sampled_margins(roll_loop(0.0)).delay_margin
    for there in (0.0021, 0.005, 0.0149, 0.0202):
        assert sampled_margins(roll_loop(there)).delay_margin == pytest.approx(whole - there, abs=1e-12)


def test_margins_hold_on_the_closed_loop() -> None:
    found = sampled_margins(roll_loop(0.015))
    closed = np.array(roll_bench({"table": 0.015}).M)
    for factor, stable in ((found.gain_margin * (1 - 1e-9), True), (found.gain_margin * (1 + 1e-9), False)):
        M = closed.copy()
        M[10] *= factor  # the row q of the autopilot
        bench = roll_bench({"table": 0.015})
        scaled = SampledSystem(
            M, 8, bench.delays, bench.samplers, bench.inputs, bench.outputs, bench.state_names
        )
        assert sampled_stable(scaled) is stable


def test_sweep_of_the_table_delay() -> None:
    answers, intervals = sweep_sampled_margins(roll_loop, np.linspace(0.0, 0.03, 7))
    edge = sampled_margins(roll_loop(0.0)).delay_margin
    assert intervals == ((0.0, pytest.approx(edge, abs=1e-12)),)
    assert [a.stable for a in answers] == [True, True, True, True, True, False, False]
    assert answers[5].delay_margin is None and answers[5].why["delay_margin"] == "closed loop unstable"


def first_order(gain: float, period: float) -> SampledLoop:
    """x' = -x + v, v = -g x sampled: L(z) = g (1 - a)/(z - a), a = e^{-T}."""
    M = np.array([[-1.0, 0.0, 1.0], [-gain, 0.0, 0.0], [0.0, 1.0, 0.0]])
    opened = SampledSystem(M, 1, (), (holder(period),), ("e",), ("y",), ("x",))

    def closed_at(tau: float) -> SampledSystem:
        closed = np.array([[-1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-gain, 0.0, 0.0]])
        return SampledSystem(closed, 1, (tau,), (holder(period),), (), (), ("x",))

    return SampledLoop(opened, "e", period, closed_at)


def test_crossing_at_half_the_sampling_rate() -> None:
    # z = -1 at gain (1 + a)/(1 - a): the only loss of stability is at π/T
    a = np.exp(-0.5)
    found = sampled_margins(first_order(2.0, 0.5))
    assert found.gain_margin == pytest.approx((1 + a) / (1 - a) / 2.0, rel=1e-13)
    assert found.gain_margin_frequency == pytest.approx(np.pi / 0.5, rel=1e-15)


def test_delay_margin_is_no_multiple_of_the_period() -> None:
    # with f of a period: (z - a) z = -g ((1 - b) z + (b - a)), b = e^{-(1-f)T}; pair on |z| = 1: g (b - a) = 1
    g, period = 4.0, 0.5
    a = np.exp(-period)
    edge = brentq(lambda f: g * (np.exp(-(1 - f) * period) - a) - 1.0, 0.0, 1.0)
    margin = sampled_margins(first_order(g, period)).delay_margin
    assert margin == pytest.approx(edge * period, rel=1e-10)


def test_never() -> None:
    found = sampled_margins(first_order(0.5, 0.5))
    assert found.delay_margin is None and found.why["delay_margin"] == "never"


def test_pulse_transfer_in_closed_form() -> None:
    a = np.exp(-0.5)
    omega = np.linspace(0.1, np.pi / 0.5, 30)
    lifted = lift(first_order(2.0, 0.5).opened, {"e": 0.5})
    expected = 2.0 * (1 - a) / (np.exp(0.5j * omega) - a)
    assert -lifted.pulse(omega)[:, 0, 0] == pytest.approx(expected, rel=1e-12)


def test_faster_signal_of_a_two_rate_loop_has_no_pulse_transfer() -> None:
    loop = SampledLoop(
        roll_bench(opened=True, autopilot=2 * T),
        "e",
        T,
        lambda tau: roll_bench({"fin": tau}, autopilot=2 * T),
    )
    with pytest.raises(AnalysisError, match="several rates"):
        sampled_margins(loop)
