"""Dynamic, encoder-referenced and lead compensation: ultimate gains of the thesis's rate loop, two ways, and runs."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from delaytools.analysis.questions import loop_margins, transfer
from delaytools.blocks.block import Block
from delaytools.blocks.delay import Delay, VariableDelay
from delaytools.blocks.integrator import Integrator
from delaytools.blocks.second_order import SecondOrder
from delaytools.compensators.dynamic import DynamicCompensator, DynamicCompensatorAlone
from delaytools.compensators.encoder_referenced import EncoderReferencedCompensator
from delaytools.compensators.lead import LeadCompensator
from delaytools.loop.edit import remove
from delaytools.loop.loop import Element, Loop
from delaytools.signals.expression import Expression
from delaytools.signals.stimulus import Multisine, Step
from delaytools.simulation.simulate import simulate
from tests.simulation.benches import element

ACTUATOR, SENSOR = SecondOrder(natural_frequency=180.0, damping=0.6), SecondOrder(natural_frequency=377.0, damping=0.6)
FLIGHT = 130.8  # ultimate gain, rad/s: shared/facts/test_bed.md item 3
REFERENCED = EncoderReferencedCompensator(natural_frequency=377.0, damping=0.6)


def compensated(block: Block) -> Element:
    names = {"input": "sensed", "desired": "rate", "actual": "table"}
    return Element("compensator", block, {port: Expression(names[port]) for port in block.inputs}, {"output": "y"})


def rate_loop(tau: float, block: Block) -> Loop:
    """A(s)/s with the table's delay, the sensor and a compensator behind it, unity feedback of its output."""
    return Loop(
        (
            element("actuator", ACTUATOR, "demand - y", "fin"),
            element("airframe", Integrator(), "fin", "rate"),
            element("table_delay", Delay(delay=tau), "rate", "table"),
            element("sensor", SENSOR, "table", "sensed"),
            compensated(block),
        )
    )


def ultimate(tau: float, block: Block) -> float:
    found = loop_margins(rate_loop(tau, block), "fin").margins[0].gain_margin
    assert found is not None
    return found


def by_formula(feedback: Callable[[complex], complex]) -> float:
    """1/|L| at the largest crossing of -180 deg of A F/s: a scan, then a root of the imaginary part."""

    def L(w: float) -> complex:
        s = 1j * w
        return 180**2 / (s**2 + 216 * s + 180**2) / s * feedback(s)

    w = np.linspace(20.0, 1000.0, 4001)
    values = np.array([L(one) for one in w])
    rising = np.flatnonzero((values.imag[:-1] < 0) & (values.imag[1:] >= 0) & (values.real[:-1] < 0))
    found = [brentq(lambda x: L(x).imag, w[i], w[i + 1], xtol=1e-12) for i in rising]
    return 1 / max(abs(L(one)) for one in found)


def sensor(s: complex, w: float = 377.0) -> complex:
    return w**2 / (s**2 + 1.2 * w * s + w**2)


@pytest.mark.parametrize(("gain", "expected"), [(0.0, 59.99), (1.0, 228.0), (1.2, 180.0)])
def test_dynamic_compensation_promises_too_much(gain: float, expected: float) -> None:
    late = lambda s: np.exp(-0.015 * s)  # noqa: E731
    formula = by_formula(lambda s: sensor(s) * late(s) + gain * (1 - late(s)))
    assert ultimate(0.015, DynamicCompensator(K_con=gain)) == pytest.approx(formula, rel=1e-8)
    assert formula == pytest.approx(expected, abs=0.5)


@pytest.mark.parametrize("tau", [0.0, 0.005, 0.015, 0.0371])
def test_encoder_referenced_gives_flight_for_any_delay(tau: float) -> None:
    assert by_formula(sensor) == pytest.approx(FLIGHT, abs=0.05)
    assert ultimate(tau, REFERENCED) == pytest.approx(by_formula(sensor), rel=1e-8)


@pytest.mark.parametrize(("share", "expected"), [(0.8, 106.0), (1.2, 157.0)])
def test_encoder_referenced_with_a_wrong_model(share: float, expected: float) -> None:
    block = replace(REFERENCED, natural_frequency=share * 377.0)
    formula = by_formula(lambda s: sensor(s) * np.exp(-0.015 * s) + sensor(s, share * 377.0) * (1 - np.exp(-0.015 * s)))
    assert ultimate(0.015, block) == pytest.approx(formula, rel=1e-8)
    assert formula == pytest.approx(expected, rel=0.01)


def test_encoder_referenced_under_a_varying_delay() -> None:
    """S w + S (r - w) = S r, also where the table's delay swings between 5 and 25 ms."""
    loop = Loop(
        (
            element("table", VariableDelay(mean=0.015, amplitude=0.010, frequency=3.0), "rate", "table"),
            element("sensor", SENSOR, "table", "sensed"),
            compensated(REFERENCED),
            element("truth", SENSOR, "rate", "wanted"),
        )
    )
    drive = Multisine(amplitude=1.0, from_frequency=1.0, to_frequency=12.0, lines=12)
    run = simulate(loop, {"rate": drive}, duration=1.0).record
    assert np.max(np.abs(run["y"] - run["wanted"])) < 2e-6
    assert np.max(np.abs(run["sensed"] - run["wanted"])) > 0.3


def test_dynamic_run_is_the_equation() -> None:
    run = simulate(rate_loop(0.015, DynamicCompensator(K_con=1.2)), {"demand": Step(amplitude=1.0)}, duration=0.3)
    r = run.record
    assert r["y"] == pytest.approx(r["sensed"] + 1.2 * (r["rate"] - r["table"]), abs=1e-12)


def test_as_printed_it_differentiates() -> None:
    printed = compensated(DynamicCompensatorAlone(K_con=1.2))
    loop = Loop((element("table", Delay(delay=0.015), "rate", "table"), printed))
    G = transfer(loop, "rate", "y")
    assert abs(G.siso(0.0)) < 1e-12
    assert G.siso(0.01j) / 0.01j == pytest.approx(1.2 * 0.015, rel=1e-3)
    run = simulate(loop, {"rate": Step(amplitude=1.0)}, duration=0.1).record
    assert run["y"][-1] == pytest.approx(0.0, abs=1e-12)


def test_neutral_and_removed_are_wires() -> None:
    plain = rate_loop(0.015, DynamicCompensator(K_con=0.0))
    assert loop_margins(plain, "fin").margins[0].gain_margin == pytest.approx(59.99, abs=0.01)
    bare = remove(rate_loop(0.015, REFERENCED), "compensator")
    assert loop_margins(bare, "fin").margins[0].gain_margin == pytest.approx(59.99, abs=0.01)


def test_lead_by_linear_form_and_by_running() -> None:
    loop = Loop((element("lead", LeadCompensator(tau=0.015, N=10.0), "u", "y"),))
    s = 1j * np.geomspace(1, 1e4, 50)
    assert transfer(loop, "u", "y").siso(s) == pytest.approx((1 + 0.015 * s) / (1 + 0.0015 * s), rel=1e-12)
    run = simulate(loop, {"u": Step(amplitude=1.0)}, duration=0.02, substeps=16).record
    expected = 1 + 9 * np.exp(-run.time / 0.0015)
    assert run["y"] == pytest.approx(expected, rel=1e-7)
    peak = np.angle((1 + 0.015 * 1j * math.sqrt(10) / 0.015) / (1 + 0.0015 * 1j * math.sqrt(10) / 0.015))
    assert peak == pytest.approx(math.asin(9 / 11))
