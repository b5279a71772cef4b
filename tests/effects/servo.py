"""A small servo loop to put effects into, and an element alone on an external command."""

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.equations import Equations
from delaytools.blocks.first_order import FirstOrder
from delaytools.blocks.gain import Gain
from delaytools.blocks.integrator import Integrator
from delaytools.blocks.sample_hold import SampleHold
from delaytools.blocks.second_order import SecondOrder
from delaytools.blocks.transfer_function import TransferFunction
from delaytools.effects.effect import Effect, Place, check_place
from delaytools.loop.loop import Element, Loop
from delaytools.loop.port import find_port
from delaytools.signals.expression import Expression
from delaytools.signals.stimulus import Column, Sine, Stimulus
from delaytools.simulation.compiling import compile_loop
from delaytools.simulation.run import run

Array = NDArray[np.float64]
FREQUENCY, DAMPING, PERIOD, DURATION = 40.0, 0.6, 0.005, 1.5
DRAWS = np.random.default_rng(7).uniform(size=400)
LATE = Column(time=np.linspace(0.0, 3.0, 31), values=0.02 + 0.005 * np.linspace(-1.0, 1.0, 31))
STIMULI: dict[str, Stimulus] = {
    "demand": Sine(amplitude=1.0, frequency=1.3),
    "gust": Sine(amplitude=0.7, frequency=2.1, phase=0.4),
    "late": LATE,
    "dropped_frames@sampler.output.draw": Column(time=PERIOD * np.arange(400), values=DRAWS, held=True),
}


def element(name: str, block: object, reads: str, writes: str) -> Element:
    """A block with one input and one output in its place."""
    return Element(name, block, {"input": Expression(reads)}, {"output": writes})  # type: ignore[arg-type]


def servo(feedback: str = "probed") -> Loop:
    """A rate servo; `probe` is a wire whose two ends, measured and probed, are both recorded."""
    elements = (
        element("controller", Gain(), f"kp*(demand - {feedback})", "command"),
        element("actuator", SecondOrder(natural_frequency=FREQUENCY, damping=DAMPING), "command", "position"),
        element("plant", TransferFunction(numerator=(10.0,), denominator=(1.0, 2.0)), "position", "rate"),
        element("gyro", FirstOrder(time_constant=0.02), "rate", "measured"),
        element("probe", Gain(), "measured", "probed"),
        element("sampler", SampleHold(period=PERIOD), "probed", "sampled"),
        element("attitude", Integrator(), "rate", "angle"),
    )
    return Loop(elements, {"kp": 0.5})


def alone(block: object) -> Loop:
    """One element, driven by the external signal `demand`."""
    return Loop((element("actuator", block, "demand", "position"),))


def drive() -> Loop:
    """A mass with viscous friction, written as equations."""
    rates = {"q": Expression("v"), "v": Expression("(u - viscous*v)/mass")}
    block = Equations(
        input_names=("u",),
        start={"q": 0.0, "v": 0.0},
        parameters={"mass": 0.05, "viscous": 0.2},
        rates=rates,
        formulas={"position": Expression("q"), "speed": Expression("v")},
    )
    wired = Element("drive", block, {"u": Expression("demand")}, {"position": "position", "speed": "speed"})
    return Loop((wired,))


def placed(loop: Loop, effect: Effect, at: str, index: int = 0) -> Loop:
    """The loop with the effect at the port, as the design room puts it there."""
    place = Place(find_port(loop, at), f"{effect.kind}@{at}", f"effects.{index}")
    check_place(effect, place)
    return effect.apply(loop, place)


def rows(loop: Loop, *, substeps: int | None = None, duration: float = DURATION) -> dict[str, Array]:
    """The columns of a run by name, with the time as `t`."""
    compiled = compile_loop(loop, STIMULI, duration=duration, substeps=substeps)
    t, table = run(compiled)
    return {"t": t} | {name: table[:, i] for i, name in enumerate(compiled.model.layout.signals)}
