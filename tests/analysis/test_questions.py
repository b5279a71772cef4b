"""Questions to a whole loop: the roll bench of p03, a continuous rate loop, delays in series and not."""

import numpy as np
import pytest

from delaytools.analysis.opened_loop import open_loop
from delaytools.analysis.questions import loop_margins, loop_roots, transfer
from delaytools.blocks.dead_band import DeadBand
from delaytools.blocks.delay import Delay
from delaytools.blocks.gain import Gain
from delaytools.blocks.integrator import Integrator
from delaytools.blocks.second_order import SecondOrder
from delaytools.linear.algebra import delay, feedback
from delaytools.linear.convert import from_control
from delaytools.loop.loop import Loop
from delaytools.signals.trouble import AnalysisError, DelaytoolsError
from delaytools.simulation.simulate import simulate
from tests.simulation.benches import DOUBLET, TABLE, element, late, rate_loop, roll_bench, with_block

control = pytest.importorskip("control")


def sensor_loop(gain: float) -> Loop:
    """K A(s) S(s) / s, the sensor in the feedback."""
    return Loop(
        (
            element("gain", Gain(gain=gain), "reference - sensed", "command"),
            element("actuator", SecondOrder(natural_frequency=180.0, damping=0.6), "command", "fin"),
            element("airframe", Integrator(), "fin", "rate"),
            element("sensor", SecondOrder(natural_frequency=377.0, damping=0.6), "rate", "sensed"),
        )
    )


def test_p03_at_a_sampled_signal_is_exact() -> None:
    """Published check of the contract: 2.1696 and 20.2305 ms; with 15 ms in place 1.1724, 12.25 deg, 5.23 ms."""
    sweep = loop_margins(roll_bench(), "fin_command", [0.0, 0.015], delay_at=TABLE)
    free, late_ = sweep.margins
    assert free.sampling == "exact"
    assert free.gain_margin == pytest.approx(2.1696, abs=5e-5)
    assert free.delay_margin == pytest.approx(0.0202305, abs=5e-8)
    assert late_.gain_margin == pytest.approx(1.1724, abs=5e-5)
    assert np.degrees(late_.phase_margin or 0) == pytest.approx(12.25, abs=5e-3)
    assert late_.delay_margin == pytest.approx(0.00523, abs=5e-6)


def test_delay_margin_of_p03_is_where_runs_begin_to_grow() -> None:
    """An independent look: the nonlinear run decays just below the delay margin and grows just above it."""
    edge = loop_margins(roll_bench(), "fin_command").margins[0].delay_margin
    assert edge is not None
    for tau, grows in ((edge - 3e-5, False), (edge + 3e-5, True)):
        run = simulate(late(TABLE, tau), DOUBLET, duration=40.0).record
        early = np.max(np.abs(run["roll_rate"][10_000:15_000]))
        final = np.max(np.abs(run["roll_rate"][-5_000:]))
        assert bool(final > early) is grows


def test_opened_at_a_continuous_signal_says_so() -> None:
    found = loop_margins(roll_bench(), "roll_rate")
    assert found.margins[0].sampling == "continuous approximation"
    assert "not written by a sampled block" in found.why_approximate
    assert found.margins[0].gain_margin == pytest.approx(2.1696, rel=2e-3)


def test_the_extra_delay_of_a_given_place_is_the_delay_block_there() -> None:
    """A sweep over an extra delay equals the loop with that delay written down."""
    for at in ("fin_command", "roll_rate", "sampled_rate"):
        swept = loop_margins(roll_bench(), at, [0.0073], delay_at="actuator.input").margins[0]
        written = loop_margins(late("actuator.input", 0.0073), at).margins[0]
        assert swept.gain_margin == pytest.approx(written.gain_margin, rel=1e-9)
        assert swept.phase_margin == pytest.approx(written.phase_margin, rel=1e-9)


def test_a_delay_that_is_not_in_series_moves_the_gain_crossover() -> None:
    """An inner loop with the delay, opened outside it: every delay compared with the written-down loop."""
    inner = (
        element("inner", Integrator(), "40*(command - rate)", "rate"),
        element("outer", Integrator(), "rate", "angle"),
        element("law", Gain(gain=8.0), "reference - angle", "command"),
    )
    delays = [0.0, 0.01, 0.03, 0.05]
    sweep = loop_margins(Loop(inner), "command", delays, delay_at="inner.input")
    for tau, found in zip(delays, sweep.margins, strict=True):
        written = with_block(Loop(inner), "inner.input", Delay(delay=tau)) if tau else Loop(inner)
        alone = loop_margins(written, "command").margins[0]
        assert found.stable == alone.stable
        assert (found.gain_margin or 0.0) == pytest.approx(alone.gain_margin or 0.0, rel=1e-9)
        assert (found.delay_margin or 0.0) == pytest.approx(alone.delay_margin or 0.0, rel=1e-9)
    assert len({m.phase_margin_frequency for m in sweep.margins if m.stable}) > 1
    (low, high) = sweep.stable_delays[0]
    for tau, stable in ((high - 1e-6, True), (min(high + 1e-6, 0.05), high == 0.05)):
        roots = loop_roots(Loop(inner), "command", delays=[tau], delay_at="inner.input").sets[0]
        assert bool(roots.roots[0].real < 0) is stable
    assert low == 0.0


def test_return_ratio_has_no_sign_rule_but_minus() -> None:
    """L = -R: opened at any signal of a single loop, L is the same loop gain."""
    loop = sensor_loop(50.0)
    s = np.array([1j, 30j, 100j + 1])
    values = [open_loop(loop, at).transfer(0.0).siso(s) for at in ("command", "fin", "rate", "sensed")]
    a = control.tf([180.0**2], [1, 2 * 0.6 * 180, 180.0**2])
    b = control.tf([377.0**2], [1, 2 * 0.6 * 377, 377.0**2])
    expected = from_control(50.0 * a * b * control.tf([1], [1, 0])).siso(s)
    for value in values:
        assert np.allclose(value, expected, rtol=1e-12)


def test_ultimate_gain_of_the_rate_loop() -> None:
    """Rao's elements: 130.8 rad/s without delay, 59.99 with 15 ms (published digits)."""
    for tau, ultimate in ((0.0, 130.8), (0.012, 67.2), (0.015, 59.99), (0.018, 54.1)):
        found = loop_margins(sensor_loop(50.0), "command", [tau], delay_at="sensor.input").margins[0]
        assert 50.0 * (found.gain_margin or 0) == pytest.approx(ultimate, abs=0.05)


def test_roots_of_a_loop_equal_those_of_the_algebra() -> None:
    loop = rate_loop(0.015)
    a = control.tf([180.0**2], [1, 2 * 0.6 * 180, 180.0**2])
    b = control.tf([377.0**2], [1, 2 * 0.6 * 377, 377.0**2])
    closed = feedback(delay(0.015) * from_control(40.0 * a * b * control.tf([1], [1, 0])))
    found = loop_roots(loop, "command").sets[0]
    assert found.certified
    for root in found.roots:
        values = np.linalg.svd(closed.characteristic_matrix(np.array([root]))[0], compute_uv=False)
        assert values[-1] < 1e-6 * values[0]


def test_gain_locus_crosses_the_axis_at_the_gain_margin() -> None:
    for loop in (sensor_loop(50.0), roll_bench()):
        at = "command" if "command" in loop.signals else "fin_command"
        margin = loop_margins(loop, at).margins[0].gain_margin
        assert margin is not None
        sets = loop_roots(loop, at, gains=[margin * (1 - 1e-6), margin * (1 + 1e-6)]).sets
        assert sets[0].roots[0].real < 0 < sets[1].roots[0].real
        assert all(item.certified for item in sets)


def test_amplitude_dependent_effects_are_named() -> None:
    loop = with_block(roll_bench(), "actuator.input", DeadBand(half_width=0.3))
    found = loop_margins(loop, "fin_command").margins[0]
    assert any("DeadBand" in name for name in found.linearised_without)
    assert found.gain_margin == pytest.approx(2.1696, abs=5e-5)


def test_closed_transfer_from_demand_to_rate() -> None:
    loop = sensor_loop(50.0)
    s = 1j * np.array([1.0, 20.0, 60.0])
    L = open_loop(loop, "command").transfer(0.0).siso(s)
    found = transfer(loop, "reference", "sensed").siso(s)
    assert np.allclose(found, L / (1 + L), rtol=1e-12)


def test_closed_transfer_from_one_signal_to_another() -> None:
    """A disturbance added to the fin: to itself S, to the sensed rate S times what lies between."""
    loop = sensor_loop(50.0)
    s = 1j * np.array([1.0, 20.0, 60.0])
    L = open_loop(loop, "fin").transfer(0.0).siso(s)
    assert np.allclose(transfer(loop, "fin", "fin").siso(s), 1 / (1 + L), rtol=1e-12)
    assert np.allclose(transfer(loop, "fin", "rate").siso(s), 1 / s / (1 + L), rtol=1e-12)
    with pytest.raises(DelaytoolsError, match="unknown signal"):
        transfer(loop, "finn", "rate")


def test_wrong_questions_are_answered_in_words() -> None:
    with pytest.raises(DelaytoolsError, match="nearest: fin_command"):
        loop_margins(roll_bench(), "fin_comand")
    with pytest.raises(DelaytoolsError, match="unknown port"):
        loop_margins(roll_bench(), "fin_command", [0.0], delay_at="motion_table.inptu")
    with pytest.raises(AnalysisError, match="not negative"):
        loop_margins(roll_bench(), "fin_command", [-1e-3])
    with pytest.raises(AnalysisError, match="one parameter"):
        loop_roots(roll_bench(), "fin_command", delays=[0.0], gains=[1.0])
