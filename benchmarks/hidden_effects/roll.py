"""The roll bench: autopilot, actuator, airframe, motion table, gyro."""

from benchmarks.hidden_effects.architecture import (
    Architecture,
    BlockPlan,
    Controller,
    Offer,
    Output,
    element,
)
from benchmarks.hidden_effects.blocks import ForcePort

BOTH_SIDES = ("dead_band", "backlash", "saturation", "quantization", "sample_hold", "rate_limit")
TIMING = ("delay", "variable_delay", "lag")
READING = ("scale_factor", "bias", "gain_drift", "transient_gain", "periodic_interference")
INSIDE = (
    "coulomb_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "cubic_stiffness",
    "cubic_damping",
    "quadratic_drag",
)


def element_offers(name: str, signal: str, source: str, upstream: tuple[str, ...]) -> tuple[Offer, ...]:
    """What may be missing at an element whose input and output have one unit."""
    exits, changes = (signal,), (f"{name}.natural_frequency", f"{name}.damping")
    return (
        Offer(f"{name}.input", exits, TIMING + BOTH_SIDES, scale_of=source),
        Offer(
            f"{name}.output",
            exits,
            (
                *READING,
                "flexible_mode",
                "cross_coupling",
                "dead_band",
                "backlash",
                "saturation",
                "quantization",
            ),
            sources=upstream,
            scale_of=signal,
        ),
        Offer(name, exits, ("parameter_change",), changes=changes, scale_of=signal),
    )


def moving_offers(name: str, signal: str) -> tuple[Offer, ...]:
    """What may act on the moving mass of an element."""
    return (
        Offer(f"{name}.rate", (signal,), ("rate_limit",), scale_of=signal),
        Offer(f"{name}.rate'", (signal,), INSIDE, scale_of=signal),
    )


def controller_offers(name: str, command: str, coupled: str) -> tuple[Offer, ...]:
    """What may be missing in and behind the on-board computer; its command stays a held signal."""
    return (
        Offer(
            f"{name}.input",
            (command,),
            ("delay", "lag", "gain_drift", "transient_gain", "cross_coupling"),
            sources=(coupled,),
            scale_of=command,
        ),
        Offer(
            f"{name}.output",
            (command,),
            ("scale_factor", "bias", "dead_band", "backlash", "saturation", "quantization", "dropped_frames"),
            scale_of=command,
        ),
    )


AIRFRAME = BlockPlan(
    "airframe",
    "input",
    "fin_position",
    lambda v: ([[-v["airframe.denominator[1]"]]], [v["airframe.numerator[0]"]]),
    (Output("output", "roll_rate", lambda v: (1.0,)),),
    {"airframe.output'": ForcePort(0, None)},
)

OFFERS = (
    *controller_offers("autopilot", "fin_command", "pitch_rate"),
    Offer(
        "rate_sampler.input", ("fin_command",), ("delay", "scale_factor", "dead_band"), scale_of="sensed_rate"
    ),
    *element_offers("actuator", "fin_position", "fin_command", ("fin_command", "pitch_rate")),
    *moving_offers("actuator", "fin_position"),
    Offer(
        "airframe.input",
        ("roll_rate",),
        (
            "delay",
            "variable_delay",
            "lag",
            "scale_factor",
            "gain_drift",
            "transient_gain",
            "dead_band",
            "backlash",
        ),
        scale_of="fin_position",
    ),
    Offer(
        "airframe.output'",
        ("roll_rate",),
        ("constant_disturbance", "cross_coupling", "coulomb_friction", "cubic_damping", "quadratic_drag"),
        sources=("pitch_rate",),
        scale_of="roll_rate",
        is_rate=True,
    ),
    Offer(
        "airframe",
        ("roll_rate",),
        ("parameter_change",),
        changes=("airframe.denominator[1]",),
        scale_of="roll_rate",
    ),
    *element_offers("motion_table", "table_rate", "roll_rate", ("fin_position", "fin_command", "pitch_rate")),
    Offer("motion_table.rate", ("table_rate",), ("rate_limit",), scale_of="table_rate"),
    *element_offers(
        "gyro", "sensed_rate", "table_rate", ("fin_position", "fin_command", "roll_rate", "pitch_rate")
    ),
)


TEXT = """
[parameters]
kp = <kp>
kphi = <kphi>

[signals]
roll_demand = "deg"
fin_command = "deg"
fin_position = "deg"
roll_rate = "deg/s"
table_rate = "deg/s"
sensed_rate = "deg/s"
sampled_rate = "deg/s"
roll_estimate = "deg"

[blocks.rate_sampler]
type = "sample_hold"
input = "sensed_rate"
output = "sampled_rate"
period = "5 ms"

[blocks.attitude]
type = "integrator"
input = "sampled_rate"
output = "roll_estimate"

[blocks.autopilot]
type = "sample_hold"
input = "kphi*(roll_demand - roll_estimate) - kp*sampled_rate"
output = "fin_command"
period = "5 ms"

[blocks.actuator]
type = "second_order"
input = "fin_command"
output = "fin_position"
natural_frequency = "<actuator.natural_frequency> rad/s"
damping = <actuator.damping>

[blocks.airframe]
type = "transfer_function"
input = "fin_position"
output = "roll_rate"
numerator = [<airframe.numerator[0]>]
denominator = [1.0, <airframe.denominator[1]>]

[blocks.motion_table]
type = "second_order"
input = "roll_rate"
output = "table_rate"
natural_frequency = "<motion_table.natural_frequency> rad/s"
damping = <motion_table.damping>

[blocks.gyro]
type = "second_order"
input = "table_rate"
output = "sensed_rate"
natural_frequency = "<gyro.natural_frequency> rad/s"
damping = <gyro.damping>
"""


ROLL = Architecture(
    name="roll",
    title="Roll channel of a hardware-in-the-loop bench",
    externals=("roll_demand", "pitch_rate"),
    units={
        "roll_demand": "deg",
        "fin_command": "deg",
        "fin_position": "deg",
        "roll_rate": "deg/s",
        "table_rate": "deg/s",
        "sensed_rate": "deg/s",
        "pitch_rate": "deg/s",
    },
    controller=Controller(
        "autopilot",
        "fin_command",
        5,
        (("rate_sampler", "sensed_rate", "sampled_rate"),),
        lambda v: {"sampled_rate": 1.0},
        lambda v: {"roll_demand": v["kphi"], "integral": -v["kphi"], "sampled_rate": -v["kp"]},
    ),
    chain=(
        element("actuator", "fin_command", "fin_position"),
        AIRFRAME,
        element("motion_table", "roll_rate", "table_rate"),
        element("gyro", "table_rate", "sensed_rate"),
    ),
    numbers={
        "kp": (0.045, 0.15),
        "kphi": (0.25, 0.2),
        "actuator.natural_frequency": (180.0, 0.2),
        "actuator.damping": (0.6, 0.15),
        "airframe.numerator[0]": (900.0, 0.15),
        "airframe.denominator[1]": (2.0, 0.2),
        "motion_table.natural_frequency": (400.0, 0.2),
        "motion_table.damping": (0.7, 0.15),
        "gyro.natural_frequency": (377.0, 0.2),
        "gyro.damping": (0.6, 0.15),
    },
    tolerances={
        "actuator.natural_frequency": 6,
        "actuator.damping": 10,
        "motion_table.natural_frequency": 8,
        "motion_table.damping": 10,
        "gyro.natural_frequency": 8,
        "airframe.denominator[1]": 10,
    },
    inside_noise={"sensed_rate": 0.05},
    outside_noise={"fin_position": 0.01, "table_rate": 0.05},
    offers=OFFERS,
    demand_size=(4.0, 25.0),
    text=TEXT,
)
