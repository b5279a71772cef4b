"""Limit cycles: published problems, exact answers, and simulations that agree."""

import math
from itertools import pairwise

import numpy as np
import pytest

from delaytools.analysis.cycle_check import Predicted, checked
from delaytools.analysis.harmonic_balance import polished
from delaytools.analysis.limit_cycles import LimitCycles, limit_cycles
from delaytools.analysis.questions import loop_margins
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.signals.trouble import AnalysisError, DesignError

RELAY = """
title = "Relay, lag and delay"
frame = "0.1 ms"
[blocks.relay]
type = "relay"
input = "-y"
output = "u"
level = 1.0
[blocks.late]
type = "delay"
input = "u"
output = "w"
delay = "LATE s"
[blocks.lag]
type = "first_order"
input = "w"
output = "y"
time_constant = "0.1 s"
"""

PLANT = """
title = "K/(s (s + 1) (s + 2)) behind one nonlinear piece"
frame = "20 ms"
[blocks.piece]
KIND
input = "-y"
output = "u"
[blocks.plant]
type = "transfer_function"
input = "u"
output = "y"
numerator = [GAIN]
denominator = [1.0, 3.0, 2.0, 0.0]
"""

LIMITED = """
title = "Integrator, delay and sensor behind a limit"
frame = "1 ms"
[blocks.limit]
type = "saturation"
input = "-12*y"
output = "u"
limit = 40.0
[blocks.plant]
type = "integrator"
input = "u"
output = "x"
[blocks.late]
type = "delay"
input = "x"
output = "w"
delay = "LATE s"
[blocks.sensor]
type = "second_order"
input = "w"
output = "y"
natural_frequency = "200 rad/s"
damping = 0.7
"""

VAN_DER_POL = """
title = "x'' = 0.2 (1 - x^2) x' - x"
frame = "20 ms"
[blocks.force]
type = "equations"
inputs = { x = "x", v = "v" }
outputs = { f = "0.2*(1 - x**2)*v - x" }
[blocks.speed]
type = "integrator"
input = "f"
output = "v"
[blocks.place]
type = "integrator"
input = "v"
output = "x"
"""


def cycles(text: str, at: str, **asked: object) -> LimitCycles:
    return limit_cycles(build(parse_design(text, "loop.toml")), at, **asked)  # type: ignore[arg-type]


def plant(kind: str, gain: float) -> str:
    return PLANT.replace("KIND", kind).replace("GAIN", str(gain))


@pytest.mark.parametrize(
    ("late", "hertz", "amplitude"), [(0.015, 17.6223, 0.11453), (0.1, 3.2289, 0.5629)]
)
def test_relay_with_delay(late: float, hertz: float, amplitude: float) -> None:
    """Tsypkin: half period T ln(2 e^{L/T} - 1), amplitude 1 - e^{-L/T}; describing function as given."""
    found = cycles(RELAY.replace("LATE", str(late)), "y").cycles
    assert [one.stable for one in found] == [True] + [False] * (len(found) - 1)
    first = found[0]
    assert first.frequency == pytest.approx(hertz, abs=5e-5) and first.amplitude == pytest.approx(amplitude, abs=5e-5)
    assert first.exact is not None and first.check is not None and first.check.agrees
    half = 0.1 * math.log(2 * math.exp(late / 0.1) - 1)
    assert first.exact.frequency == pytest.approx(0.5 / half, rel=1e-12)
    assert first.exact.amplitude == pytest.approx(1 - math.exp(-late / 0.1), rel=1e-12)
    assert first.check.frequency == pytest.approx(first.exact.frequency, rel=5e-3)


def test_relay_with_hysteresis_against_the_closed_form() -> None:
    """It goes on from h for the delay, m = 1 - (1 - h) e^{-L/T}, then back to -h: half L + T ln((1 + m)/(1 - h))."""
    text = RELAY.replace("LATE", "0.05").replace("level = 1.0", "level = 1.0\nhalf_width = 0.3")
    first = cycles(text, "y", check=False).cycles[0]
    assert first.exact is not None and first.stable
    largest = 1 - 0.7 * math.exp(-0.5)
    assert 0.5 / first.exact.frequency == pytest.approx(0.05 + 0.1 * math.log((1 + largest) / 0.7), rel=1e-12)
    assert first.exact.amplitude == pytest.approx(largest, rel=1e-9)
    assert first.frequency == pytest.approx(first.exact.frequency, rel=0.1)


def test_a_cycle_that_first_harmonics_do_not_see_is_told() -> None:
    """A relay with hysteresis around one lag: its cycle is a chain of exponentials, half T ln((1 + h)/(1 - h))."""
    text = RELAY.replace("LATE", "0.0").replace("level = 1.0", "level = 1.0\nhalf_width = 0.5")
    found = cycles(text, "y", check=False)
    assert found.cycles == () and f"{0.5 / (0.1 * math.log(3.0)):.6g} Hz" in found.why


def test_saturation_holds_an_unstable_loop() -> None:
    """Phase -180 deg at √2 rad/s, where K/6 is the gain: N = 0.6 for K = 10, and a cycle that lasts."""
    (found,) = cycles(plant('type = "saturation"\nlimit = 0.5', 10.0), "y").cycles
    assert found.frequency * 2 * math.pi == pytest.approx(math.sqrt(2.0), rel=1e-9)
    r = 0.5 / found.amplitude
    assert 2 / math.pi * (math.asin(r) + r * math.sqrt(1 - r**2)) == pytest.approx(0.6, rel=1e-9)
    assert found.stable and found.check is not None and found.check.agrees
    assert found.check.amplitude == pytest.approx(found.amplitude, rel=0.03)
    assert found.pieces[0].gain == pytest.approx(0.6, rel=1e-9) and found.pieces[0].drives is False


@pytest.mark.parametrize("delay", [0.124, 0.1245, 0.125, 0.127, 0.14])
def test_a_cycle_hardly_above_the_limit_is_found(delay: float) -> None:
    """The loop is lost at 0.1239 s. Below its limit a saturation says nothing of the size: no start is there."""
    (found,) = cycles(LIMITED.replace("LATE", str(delay)), "u", check=False).cycles
    s, r = 2j * math.pi * found.frequency, 40.0 / (found.pieces[0].amplitude)
    N = 2 / math.pi * (math.asin(r) + r * math.sqrt(1 - r**2))
    L = 12.0 / s * np.exp(-delay * s) * 200.0**2 / (s**2 + 280.0 * s + 200.0**2)
    assert found.stable and N > 0.8 and abs(1 + N * L) < 1e-8


def test_the_threshold_of_a_dead_band_is_no_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing comes back it has no phase: the cells beside are not looked at one by one."""
    tried = []

    def counted(*given: object) -> object:
        tried.append(given)
        return polished(*given)  # type: ignore[arg-type]

    monkeypatch.setattr("delaytools.analysis.cycle_search.polished", counted)
    (found,) = cycles(plant('type = "dead_band"\nhalf_width = 0.5', 10.0), "y", check=False).cycles
    assert not found.stable and len(tried) <= 4


def test_no_cycle_where_the_loop_is_stable_at_every_gain_below_its_own() -> None:
    found = cycles(plant('type = "saturation"\nlimit = 0.5', 5.0), "y")
    assert found.cycles == () and found.nonlinear == ("piece",) and "no amplitude" in found.why


def test_a_dead_band_parts_what_dies_out_from_what_grows() -> None:
    (found,) = cycles(plant('type = "dead_band"\nhalf_width = 0.5', 10.0), "y").cycles
    assert not found.stable and found.check is not None and found.check.agrees
    assert found.growth > 0 and found.pieces[0].gain == pytest.approx(0.6, rel=1e-9)


def test_a_stable_and_an_unstable_cycle_at_one_frequency() -> None:
    """A quantiser's gain rises to 1.27 at its first edge and falls again: with K/6 = 0.85 two amplitudes balance."""
    found = cycles(plant('type = "quantizer"\nstep = 1.0', 0.85 * 6), "y", check=False).cycles
    first = [one for one in found if one.amplitude < 1.5]
    assert [one.stable for one in sorted(first, key=lambda one: one.amplitude)] == [False, True]


def test_play_against_an_equation_written_here() -> None:
    kind = 'type = "backlash"\nhalf_width = 0.2'
    found = cycles(plant(kind, 5.0), "y", check=False).cycles
    assert found
    for one in found:
        s, b = 2j * math.pi * one.frequency, 0.2 / one.amplitude
        L = 5.0 / (s * (s + 1) * (s + 2))
        c = 1 - 2 * b
        N = 0.5 + (math.asin(c) + c * math.sqrt(1 - c**2)) / math.pi - 4j / math.pi * b * (1 - b)
        assert abs(1 + N * L) < 1e-8


def test_van_der_pol() -> None:
    """Amplitude 2 at 1 rad/s, to first order in the damping (van der Pol 1926)."""
    (found,) = cycles(VAN_DER_POL, "v").cycles
    assert found.amplitude == pytest.approx(2.0, rel=1e-7)
    assert found.frequency * 2 * math.pi == pytest.approx(1.0, rel=1e-7)
    assert found.stable and found.check is not None and found.check.agrees
    assert found.growth == pytest.approx(-0.2, rel=1e-3)  # a' = 0.1 a (1 - a²/4)


def test_a_bias_is_balanced_too() -> None:
    """A bias beside a saturation: the mean of the cycle is not zero, and the gain is that of a sine off the middle."""
    text = plant('type = "saturation"\nlimit = 0.5', 10.0)
    text += '[[effects]]\ntype = "bias"\nat = "piece.input"\nlevel = 0.3\n'
    (found,) = cycles(text, "y").cycles
    assert found.check is not None and found.check.agrees
    assert found.check.amplitude == pytest.approx(found.amplitude, rel=0.05)


def test_two_pieces_at_once_as_simulated() -> None:
    text = plant('type = "saturation"\nlimit = 0.5', 14.0)
    text += '[[effects]]\ntype = "backlash"\nat = "plant.input"\nhalf_width = 0.05\n'
    found = [one for one in cycles(text, "y").cycles if one.stable]
    assert len(found) == 1 and found[0].check is not None and found[0].check.agrees
    assert {piece.name for piece in found[0].pieces} == {"piece", "backlash@plant.input"}


def test_amplitude_and_frequency_against_delay() -> None:
    text = plant('type = "saturation"\nlimit = 0.5', 4.0)
    delays = [0.0, 0.2, 0.4, 0.8]
    found = cycles(text, "y", delays=delays, check=False).cycles
    linear = loop_margins(build(parse_design(text, "loop.toml")), "y", delays).margins
    expected = [one.delay for one in linear if not one.stable]  # a limit holds just what would grow without it
    assert len(expected) > 1 and [one.delay for one in found] == expected
    assert all(a.frequency > b.frequency and a.amplitude < b.amplitude for a, b in pairwise(found))
    for one in found:  # the phase of the loop there is -180 deg, delay included, and the gain 1/N
        s = 2j * math.pi * one.frequency
        L = 4.0 / (s * (s + 1) * (s + 2)) * np.exp(-s * one.delay)
        assert abs(1 + one.pieces[0].gain * L) < 1e-8


def test_a_linear_loop_has_none_and_says_so() -> None:
    found = cycles(plant('type = "gain"\ngain = 2.0', 10.0), "y")
    assert found.cycles == () and found.nonlinear == () and "linear loop" in found.why


def test_what_cannot_be_asked() -> None:
    with pytest.raises(DesignError, match="opened where a block writes"):
        cycles(RELAY.replace("LATE", "0.1"), "nowhere")
    with pytest.raises(AnalysisError, match="not negative"):
        cycles(RELAY.replace("LATE", "0.1"), "y", delays=[-1.0])


@pytest.mark.parametrize(
    ("amplitude", "hertz", "stable"),
    [(0.25, 17.6, True), (0.1145, 9.0, True), (0.1145, 17.6, False)],
    ids=["twice the size", "half the frequency", "said not to last"],
)
def test_a_check_disagrees_with_a_wrong_prediction(amplitude: float, hertz: float, stable: bool) -> None:
    loop = build(parse_design(RELAY.replace("LATE", "0.015"), "loop.toml"))
    assert not checked(loop, "y", Predicted(amplitude, hertz, -48.0 if stable else 48.0, stable)).agrees
