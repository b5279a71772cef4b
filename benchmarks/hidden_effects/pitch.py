"""A pitch loop with two sensors: rate gyro and accelerometer, an airframe written as equations, integral action."""

import numpy as np

from benchmarks.hidden_effects.architecture import (
    Architecture,
    BlockPlan,
    Controller,
    Offer,
    Output,
    element,
)
from benchmarks.hidden_effects.blocks import ForcePort
from benchmarks.hidden_effects.roll import controller_offers, element_offers, moving_offers

BOTH = ("pitch_rate", "acceleration")
SENSES = ("pitch_rate", "acceleration", "fin_position", "fin_command", "roll_rate")

AIRFRAME = BlockPlan(
    "airframe",
    "fin",
    "fin_position",
    lambda v: (
        [[-v["airframe.lift"], 1.0], [-v["airframe.stiffness"], -v["airframe.damping"]]],
        [v["airframe.fin_lift"], v["airframe.fin_moment"]],
    ),
    (
        Output("pitch_rate", "pitch_rate", lambda v: (0.0, 1.0)),
        Output(
            "acceleration",
            "acceleration",
            lambda v: (v["airframe.speed"] * v["airframe.lift"] * np.pi / 180, 0.0),
            lambda v: -v["airframe.speed"] * v["airframe.fin_lift"] * np.pi / 180,
        ),
    ),
    {"airframe.alpha'": ForcePort(0, None), "airframe.q'": ForcePort(1, None)},
)

OFFERS = (
    *controller_offers("autopilot", "fin_command", "roll_rate"),
    Offer(
        "rate_sampler.input", ("fin_command",), ("delay", "scale_factor", "dead_band"), scale_of="sensed_rate"
    ),
    Offer(
        "acceleration_sampler.input",
        ("fin_command",),
        ("delay", "scale_factor"),
        scale_of="sensed_acceleration",
    ),
    *element_offers("actuator", "fin_position", "fin_command", ("fin_command", "roll_rate")),
    *moving_offers("actuator", "fin_position"),
    Offer(
        "airframe.fin",
        BOTH,
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
        "airframe.q'",
        BOTH,
        ("constant_disturbance", "cross_coupling", "cubic_damping", "quadratic_drag"),
        sources=("roll_rate",),
        scale_of="pitch_rate",
        is_rate=True,
    ),
    Offer(
        "airframe",
        BOTH,
        ("parameter_change",),
        changes=("airframe.stiffness", "airframe.damping", "airframe.lift"),
        scale_of="pitch_rate",
    ),
    *element_offers("gyro", "sensed_rate", "pitch_rate", SENSES),
    *element_offers("accelerometer", "sensed_acceleration", "acceleration", SENSES),
)


TEXT = """
[parameters]
ki = <ki>
ka = <ka>
kq = <kq>

[signals]
acceleration_demand = "m/s^2"
fin_command = "deg"
fin_position = "deg"
pitch_rate = "deg/s"
acceleration = "m/s^2"
sensed_rate = "deg/s"
sensed_acceleration = "m/s^2"
sampled_rate = "deg/s"
sampled_acceleration = "m/s^2"
trim_command = "deg"

[blocks.rate_sampler]
type = "sample_hold"
input = "sensed_rate"
output = "sampled_rate"
period = "4 ms"

[blocks.acceleration_sampler]
type = "sample_hold"
input = "sensed_acceleration"
output = "sampled_acceleration"
period = "4 ms"

[blocks.trim]
type = "integrator"
input = "ki*(acceleration_demand - sampled_acceleration)"
output = "trim_command"

[blocks.autopilot]
type = "sample_hold"
input = "trim_command - ka*sampled_acceleration - kq*sampled_rate"
output = "fin_command"
period = "4 ms"

[blocks.actuator]
type = "second_order"
input = "fin_command"
output = "fin_position"
natural_frequency = "<actuator.natural_frequency> rad/s"
damping = <actuator.damping>

[blocks.airframe]
type = "equations"
inputs = { fin = "fin_position" }
states = { alpha = 0.0, q = 0.0 }
rates = { alpha = "q - lift*alpha + fin_lift*fin", q = "fin_moment*fin - stiffness*alpha - damping*q" }
outputs = { pitch_rate = "q", acceleration = "speed*pi/180*(lift*alpha - fin_lift*fin)" }

[blocks.airframe.parameters]
lift = <airframe.lift>
fin_lift = <airframe.fin_lift>
stiffness = <airframe.stiffness>
damping = <airframe.damping>
fin_moment = <airframe.fin_moment>
speed = <airframe.speed>

[blocks.gyro]
type = "second_order"
input = "pitch_rate"
output = "sensed_rate"
natural_frequency = "<gyro.natural_frequency> rad/s"
damping = <gyro.damping>

[blocks.accelerometer]
type = "second_order"
input = "acceleration"
output = "sensed_acceleration"
natural_frequency = "<accelerometer.natural_frequency> rad/s"
damping = <accelerometer.damping>
"""


PITCH = Architecture(
    name="pitch",
    title="Pitch channel with rate gyro and accelerometer",
    externals=("acceleration_demand", "roll_rate"),
    units={
        "acceleration_demand": "m/s^2",
        "fin_command": "deg",
        "fin_position": "deg",
        "pitch_rate": "deg/s",
        "acceleration": "m/s^2",
        "sensed_rate": "deg/s",
        "sensed_acceleration": "m/s^2",
        "roll_rate": "deg/s",
    },
    controller=Controller(
        "autopilot",
        "fin_command",
        4,
        (
            ("rate_sampler", "sensed_rate", "sampled_rate"),
            ("acceleration_sampler", "sensed_acceleration", "sampled_acceleration"),
        ),
        lambda v: {"acceleration_demand": v["ki"], "sampled_acceleration": -v["ki"]},
        lambda v: {"integral": 1.0, "sampled_acceleration": -v["ka"], "sampled_rate": -v["kq"]},
    ),
    chain=(
        element("actuator", "fin_command", "fin_position"),
        AIRFRAME,
        element("gyro", "pitch_rate", "sensed_rate"),
        element("accelerometer", "acceleration", "sensed_acceleration"),
    ),
    numbers={
        "ki": (0.3, 0.2),
        "ka": (0.03, 0.2),
        "kq": (0.2, 0.15),
        "actuator.natural_frequency": (170.0, 0.2),
        "actuator.damping": (0.65, 0.15),
        "airframe.lift": (1.3, 0.2),
        "airframe.fin_lift": (0.12, 0.2),
        "airframe.stiffness": (60.0, 0.2),
        "airframe.damping": (1.5, 0.2),
        "airframe.fin_moment": (130.0, 0.15),
        "airframe.speed": (600.0, 0.1),
        "gyro.natural_frequency": (350.0, 0.2),
        "gyro.damping": (0.6, 0.15),
        "accelerometer.natural_frequency": (300.0, 0.2),
        "accelerometer.damping": (0.7, 0.15),
    },
    tolerances={
        "actuator.natural_frequency": 6,
        "actuator.damping": 10,
        "gyro.natural_frequency": 8,
        "accelerometer.natural_frequency": 8,
        "airframe.stiffness": 8,
        "airframe.damping": 10,
    },
    inside_noise={"sensed_rate": 0.05, "sensed_acceleration": 0.05},
    outside_noise={"fin_position": 0.01},
    offers=OFFERS,
    demand_size=(20.0, 150.0),
    text=TEXT,
)
