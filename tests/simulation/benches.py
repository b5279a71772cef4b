"""The loops of the truth simulator's problems, built with the package."""

from delaytools.blocks.block import Block
from delaytools.blocks.dead_band import DeadBand
from delaytools.blocks.delay import Delay, VariableDelay
from delaytools.blocks.equations import Equations
from delaytools.blocks.gain import Gain
from delaytools.blocks.integrator import Integrator
from delaytools.blocks.sample_hold import SampleHold
from delaytools.blocks.saturation import Saturation
from delaytools.blocks.second_order import SecondOrder
from delaytools.blocks.transfer_function import TransferFunction
from delaytools.effects.coulomb_friction import CoulombFriction
from delaytools.loop.edit import act, insert
from delaytools.loop.loop import Element, Loop, Placed
from delaytools.loop.port import find_port
from delaytools.signals.expression import Expression
from delaytools.signals.stimulus import Doublet, Sine, Step, Stimulus


def element(name: str, block: Block, source: str, target: str) -> Element:
    """A block with one input and one output."""
    return Element(name, block, {"input": Expression(source)}, {"output": target})


def roll_bench(rate_period: float = 5e-3) -> Loop:
    """The roll bench without any effect."""
    airframe = TransferFunction(numerator=(900.0,), denominator=(1.0, 2.0))
    elements = (
        element("rate_sampler", SampleHold(period=rate_period), "sensed_rate", "sampled_rate"),
        element("attitude", Integrator(), "sampled_rate", "roll_estimate"),
        element(
            "autopilot",
            SampleHold(period=5e-3),
            "kphi*(roll_demand - roll_estimate) - kp*sampled_rate",
            "fin_command",
        ),
        element("actuator", SecondOrder(natural_frequency=180.0, damping=0.6), "fin_command", "fin_position"),
        element("airframe", airframe, "fin_position", "roll_rate"),
        element("motion_table", SecondOrder(natural_frequency=400.0, damping=0.7), "roll_rate", "table_rate"),
        element("gyro", SecondOrder(natural_frequency=377.0, damping=0.6), "table_rate", "sensed_rate"),
    )
    return Loop(elements, {"kp": 0.045, "kphi": 0.25})


def with_block(loop: Loop, port: str, block: Block) -> Loop:
    """The loop with a block at a port."""
    return insert(loop, find_port(loop, port), block)


def rate_loop(tau: float) -> Loop:
    """K A(s) S(s) e^{-sτ}/s with unity feedback; the delay on the error."""
    return Loop(
        (
            element("transport", Delay(delay=tau), "r - y", "late_error"),
            element("gain", Gain(gain=40.0), "late_error", "command"),
            element("actuator", SecondOrder(natural_frequency=180.0, damping=0.6), "command", "fin"),
            element("sensor", SecondOrder(natural_frequency=377.0, damping=0.6), "fin", "sensor"),
            element("airframe", Integrator(), "sensor", "y"),
        )
    )


def resonance_loop() -> Loop:
    """3 · 14050 e^{-0.02 s} / ((s² + 17.86 s + 14050)(0.5 s + 1)) with unity feedback; Rao 2023 eq. 3.8."""
    plant = TransferFunction(numerator=(3 * 14050.0,), denominator=(0.5, 9.93, 7042.86, 14050.0))
    return Loop(
        (
            element("transport", Delay(delay=0.02), "r - y", "late_error"),
            element("plant", plant, "late_error", "y"),
        )
    )


def delayed_integrator() -> Loop:
    """2 e^{-s}/s with unity feedback."""
    return Loop(
        (
            element("transport", Delay(delay=1.0), "r - y", "late_error"),
            element("gain", Gain(gain=2.0), "late_error", "drive"),
            element("plant", Integrator(), "drive", "y"),
        ),
        frame=0.01,
    )


def turntable() -> Loop:
    """The turntable axis with Coulomb friction of 40 deg/s², smoothed over 0.2 deg/s."""
    drive = Equations(
        input_names=("u",),
        start={"q": 0.0, "v": 0.0},
        parameters={"gain": 400.0, "viscous": 8.0},
        rates={"q": Expression("v"), "v": Expression("gain*u - viscous*v")},
        formulas={"position": Expression("q"), "rate": Expression("v")},
    )
    loop = Loop(
        (
            element("controller", SampleHold(period=2e-3), "kp*(reference - position) - kd*rate", "command"),
            Element("drive", drive, {"u": Expression("command")}, {"position": "position", "rate": "rate"}),
        ),
        {"kp": 0.9, "kd": 0.06},
    )
    friction = CoulombFriction(state="v", level=40.0, smoothing=0.2)
    return act(loop, find_port(loop, "drive.v'"), Placed(friction, "coulomb_friction@drive.v'", "effects.0"))


DOUBLET: dict[str, Stimulus] = {"roll_demand": Doublet(amplitude=5.0, start=0.5, width=0.3)}
STEP: dict[str, Stimulus] = {"r": Step(amplitude=1.0, start=0.0)}
VARYING = VariableDelay(mean=0.015, amplitude=0.003, frequency=2.0)
TABLE, ACTUATOR = "motion_table.input", "actuator.input"


def late(port: str, tau: float) -> Loop:
    """The roll bench with a delay at a port."""
    return with_block(roll_bench(), port, Delay(delay=tau))


CASES: dict[str, tuple[Loop, dict[str, Stimulus]]] = {
    "roll": (roll_bench(), DOUBLET),
    "roll, table delay 15 ms": (late(TABLE, 0.015), DOUBLET),
    "roll, table delay 12.3 ms": (late(TABLE, 0.0123), DOUBLET),
    "roll, table delay 0.4 ms": (late(TABLE, 0.0004), DOUBLET),
    "roll, command delay 3 ms": (late(ACTUATOR, 0.003), DOUBLET),
    "roll, command delay 7.3 ms": (late(ACTUATOR, 0.0073), DOUBLET),
    "roll, command delay 5 ms": (late(ACTUATOR, 0.005), DOUBLET),
    "roll, command delay 0.4 ms": (late(ACTUATOR, 0.0004), DOUBLET),
    "roll, table delay varying": (with_block(roll_bench(), TABLE, VARYING), DOUBLET),
    "roll, command delay varying": (with_block(roll_bench(), ACTUATOR, VARYING), DOUBLET),
    "rate loop, 15 ms": (rate_loop(0.015), {"r": Sine(amplitude=1.0, frequency=3.0)}),
    "rate loop, 0.3 ms": (rate_loop(0.0003), {"r": Sine(amplitude=1.0, frequency=3.0)}),
    "resonance loop": (resonance_loop(), STEP),
    "roll, dead band": (with_block(late(TABLE, 0.015), ACTUATOR, DeadBand(half_width=0.3)), DOUBLET),
    "roll, saturation": (with_block(late(TABLE, 0.015), ACTUATOR, Saturation(limit=0.5)), DOUBLET),
    "roll, rate sampled at 2 ms": (roll_bench(2e-3), DOUBLET),
    "roll, rate sampled at 3.3 ms": (roll_bench(3.3e-3), DOUBLET),
    "turntable": (turntable(), {"reference": Sine(amplitude=20.0, frequency=0.5)}),
}
