"""Reference runs: what exact simulation of each problem gives, as records (dicts of columns at 1 ms rows).

`REFERENCES` maps a name to a function without arguments; each run is made once per session, by collocation
(the tests of the truth make it again by DOP853). Angles are in deg, rates in deg/s. Numbers of the roll bench
and of the turntable axis are those of the practice cases p03 and p09 (assumed, representative); the rate loop
and the resonance of eq. 3.8 are those of the thesis.

Columns are the signals of the design files. Where a delay or a nonlinearity is put at a port, the signal
behind it has a column of its own: `table_input` (delayed roll_rate), `actuator_input` (delayed or shaped
fin_command; fin_command itself is what the autopilot computes). A dead band is u - clip(u, -h, h).
"""

from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tests.truth.integrators import Integrator, collocation
from tests.truth.method_of_steps import Delay, Input, Sampler, System, Value, Values, simulate

Record = Mapping[str, NDArray[np.float64]]
Tau = Callable[[Value], Value]

ROLL_COLUMNS = (
    "roll_demand", "fin_command", "fin_position", "roll_rate", "table_rate", "sensed_rate", "sampled_rate",
    "roll_estimate", "actuator_input", "table_input",
)


def constant(tau: float) -> Tau:
    """A delay that does not vary."""
    return lambda t: tau


def varying(t: Value) -> Value:
    """15 ms + 3 ms sin(2 pi 2 t)."""
    return 0.015 + 0.003 * np.sin(2 * np.pi * 2 * t)


def doublet(amplitude: float, start: float, width: float) -> Input:
    """+amplitude for `width` from `start`, then -amplitude for `width`, then 0."""
    levels = (0.0, amplitude, -amplitude, 0.0)
    pieces = tuple(lambda t, level=level: level for level in levels)
    return Input(pieces, (start, start + width, start + 2 * width))


def dead_band(u: float, half_width: float) -> float:
    """u - clip(u, -half_width, half_width)."""
    return u - min(max(u, -half_width), half_width)


def second_order(u: Value, y: Value, rate: Value, natural: float, damping: float) -> Value:
    """y'' = wn^2 (u - y) - 2 zeta wn y'."""
    return natural**2 * (u - y) - 2 * damping * natural * rate


def roll_bench(
    *,
    table: Tau | None = None,
    command: Tau | None = None,
    shape: Callable[[float], float] | None = None,
    rate_period: float = 5e-3,
) -> System:
    """Roll bench p03; delay at the table's input, delay of fin_command, shape at the actuator's input."""
    delays: dict[str, Delay] = {}
    if table is not None:
        delays["table_input"] = Delay("roll_rate", table, smoothing=3)
    if command is not None:
        delays["late_command"] = Delay("fin_command", command, held=True)
    arrived = "late_command" if command is not None else "fin_command"
    signals = {"actuator_input": lambda s: shape(s[arrived]) if shape is not None else s[arrived]}
    if table is None:
        signals["table_input"] = lambda s: s["roll_rate"]

    def rates(s: Values) -> tuple[Value, ...]:
        return (
            s["sampled_rate"],
            s["fin_speed"],
            second_order(s["actuator_input"], s["fin_position"], s["fin_speed"], 180.0, 0.6),
            900.0 * s["fin_position"] - 2.0 * s["roll_rate"],
            s["table_speed"],
            second_order(s["table_input"], s["table_rate"], s["table_speed"], 400.0, 0.7),
            s["gyro_speed"],
            second_order(s["table_rate"], s["sensed_rate"], s["gyro_speed"], 377.0, 0.6),
        )

    states = ("roll_estimate", "fin_position", "fin_speed", "roll_rate", "table_rate", "table_speed")
    return System(
        states=dict.fromkeys((*states, "sensed_rate", "gyro_speed"), 0.0),
        rates=rates,
        inputs={"roll_demand": doublet(5.0, 0.5, 0.3)},
        samplers=(
            Sampler("sampled_rate", rate_period, lambda s: s["sensed_rate"]),
            Sampler("fin_command", 5e-3, _fin_command),
        ),
        delays=delays,
        signals=signals,
    )


def _fin_command(s: Values) -> float:
    return 0.25 * (s["roll_demand"] - s["roll_estimate"]) - 0.045 * s["sampled_rate"]


def rate_loop(tau: float, gain: float = 40.0) -> System:
    """K A(s) S(s) e^(-s tau) / s under unity feedback, reference sin(2 pi 3 t); the delay is on the error."""

    def rates(s: Values) -> tuple[Value, ...]:
        return (
            s["fin_speed"],
            second_order(gain * s["late_error"], s["fin"], s["fin_speed"], 180.0, 0.6),
            s["sensor_speed"],
            second_order(s["fin"], s["sensor"], s["sensor_speed"], 377.0, 0.6),
            s["sensor"],
        )

    return System(
        states=dict.fromkeys(("fin", "fin_speed", "sensor", "sensor_speed", "y"), 0.0),
        rates=rates,
        inputs={"r": Input((lambda t: np.sin(2 * np.pi * 3 * t),))},
        delays={"late_error": Delay("error", constant(tau))},
        signals={"error": lambda s: s["r"] - s["y"]},
    )


def resonance_loop() -> System:
    """3 * 14050 e^(-0.02 s) / ((s^2 + 17.86 s + 14050)(0.5 s + 1)), unity feedback, unit step (eq. 3.8)."""

    def rates(s: Values) -> tuple[Value, ...]:
        force = 14050.0 * (3.0 * s["late_error"] - s["w"]) - 17.86 * s["w_rate"]
        return (s["w_rate"], force, (s["w"] - s["y"]) / 0.5)

    return System(
        states=dict.fromkeys(("w", "w_rate", "y"), 0.0),
        rates=rates,
        inputs={"r": Input((lambda t: 1.0,))},
        delays={"late_error": Delay("error", constant(0.02), smoothing=0)},
        signals={"error": lambda s: s["r"] - s["y"]},
    )


def delayed_integrator() -> System:
    """feedback(2 e^-s / s, 1), unit step."""
    return System(
        states={"y": 0.0},
        rates=lambda s: (2.0 * s["late_error"],),
        inputs={"r": Input((lambda t: 1.0,))},
        delays={"late_error": Delay("error", constant(1.0), smoothing=0)},
        signals={"error": lambda s: s["r"] - s["y"]},
    )


def turntable(level: float = 40.0) -> System:
    """Turntable p09 with Coulomb friction -level tanh(v / 0.2) at drive.v'; reference 20 sin(2 pi 0.5 t)."""

    def rates(s: Values) -> tuple[Value, ...]:
        push = 400.0 * s["command"] - 8.0 * s["rate"]
        return (s["rate"], push - level * np.tanh(s["rate"] / 0.2))

    return System(
        states={"position": 0.0, "rate": 0.0},
        rates=rates,
        inputs={"reference": Input((lambda t: 20 * np.sin(2 * np.pi * 0.5 * t),))},
        samplers=(Sampler("command", 2e-3, _turntable_command),),
    )


def _turntable_command(s: Values) -> float:
    return 0.9 * (s["reference"] - s["position"]) - 0.06 * s["rate"]


Problem = tuple[Callable[[], System], float, tuple[str, ...]]


def _roll(
    *,
    table: Tau | None = None,
    command: Tau | None = None,
    shape: Callable[[float], float] | None = None,
    rate_period: float = 5e-3,
) -> Problem:
    def system() -> System:
        return roll_bench(table=table, command=command, shape=shape, rate_period=rate_period)

    return (system, 2.0, ROLL_COLUMNS)


# name -> (system, duration in s, columns)
PROBLEMS: dict[str, Problem] = {
    "roll": _roll(),
    "roll, table delay 15 ms": _roll(table=constant(0.015)),
    "roll, table delay 12.3 ms": _roll(table=constant(0.0123)),
    "roll, table delay 0.4 ms": _roll(table=constant(0.0004)),
    "roll, command delay 3 ms": _roll(command=constant(0.003)),
    "roll, command delay 7.3 ms": _roll(command=constant(0.0073)),
    "roll, command delay 5 ms": _roll(command=constant(0.005)),
    "roll, command delay 0.4 ms": _roll(command=constant(0.0004)),
    "roll, table delay varying": _roll(table=varying),
    "roll, command delay varying": _roll(command=varying),
    "rate loop, 15 ms": (lambda: rate_loop(0.015), 1.0, ("r", "y", "error")),
    "rate loop, 0.3 ms": (lambda: rate_loop(0.0003), 1.0, ("r", "y", "error")),
    "resonance loop": (resonance_loop, 1.1, ("r", "y", "error")),
    "delayed integrator": (delayed_integrator, 3.0, ("r", "y", "error")),
    "roll, dead band": _roll(table=constant(0.015), shape=lambda u: dead_band(u, 0.3)),
    "roll, saturation": _roll(table=constant(0.015), shape=lambda u: min(max(u, -0.5), 0.5)),
    "roll, rate sampled at 2 ms": _roll(rate_period=2e-3),
    "roll, rate sampled at 3.3 ms": _roll(rate_period=3.3e-3),
    "turntable": (turntable, 2.0, ("reference", "command", "position", "rate")),
}


def solve(name: str, integrator: Integrator = collocation) -> Record:
    """The problem of that name, solved afresh with the integrator given."""
    system, duration, columns = PROBLEMS[name]
    return simulate(system(), duration, columns, integrator=integrator)


@cache
def reference(name: str) -> Record:
    """Reference record of the problem of that name; read only, made once per session."""
    record = solve(name, collocation)
    for column in record.values():
        column.flags.writeable = False
    return MappingProxyType(dict(record))


REFERENCES: dict[str, Callable[[], Record]] = {
    name: (lambda name=name: reference(name)) for name in PROBLEMS
}
