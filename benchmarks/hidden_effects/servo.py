"""A turntable axis under position control; its drive has two measured outputs."""

from benchmarks.hidden_effects.architecture import Architecture, BlockPlan, Controller, Offer, Output
from benchmarks.hidden_effects.blocks import ForcePort
from benchmarks.hidden_effects.roll import BOTH_SIDES, INSIDE, TIMING, controller_offers

BOTH = ("position", "rate")
DIRECT = ("scale_factor", "bias", "periodic_interference", "transient_gain")

DRIVE = BlockPlan(
    "drive",
    "u",
    "command",
    lambda v: ([[0.0, 1.0], [0.0, -v["drive.viscous"]]], [0.0, v["drive.gain"]]),
    (
        Output("position", "position", lambda v: (1.0, 0.0)),
        Output("rate", "rate", lambda v: (0.0, 1.0)),
    ),
    {"drive.v'": ForcePort(1, 0)},
    smoothing=0.2,
)

OFFERS = (
    *controller_offers("controller", "command", "base_rate"),
    Offer(
        "drive.u",
        BOTH,
        (*TIMING, *BOTH_SIDES, "scale_factor", "gain_drift", "transient_gain"),
        judged=("rate",),
        scale_of="command",
        same_as={"scale_factor": "drive.gain"},
    ),
    Offer(
        "drive.v'",
        BOTH,
        ("constant_disturbance", "cross_coupling", *INSIDE),
        sources=("base_rate",),
        judged=("rate",),
        scale_of="position",
    ),
    Offer(
        "drive", BOTH, ("parameter_change",), changes=("drive.viscous",), judged=("rate",), scale_of="rate"
    ),
    Offer(
        "drive.position",
        ("position",),
        ("quantization", "periodic_interference", "backlash", "scale_factor", "bias"),
        scale_of="position",
    ),
    Offer(
        "drive.rate",
        ("rate",),
        (*DIRECT, "quantization", "flexible_mode", "saturation"),
        sources=("command", "base_rate"),
        scale_of="rate",
    ),
)


TEXT = """
[parameters]
kp = <kp>
kd = <kd>

[signals]
reference = "deg"
command = "V"
position = "deg"
rate = "deg/s"

[blocks.controller]
type = "sample_hold"
input = "kp*(reference - position) - kd*rate"
output = "command"
period = "2 ms"

[blocks.drive]
type = "equations"
inputs = { u = "command" }
states = { q = 0.0, v = 0.0 }
parameters = { gain = <drive.gain>, viscous = <drive.viscous> }
rates = { q = "v", v = "gain*u - viscous*v" }
outputs = { position = "q", rate = "v" }
"""


SERVO = Architecture(
    name="servo",
    title="Turntable axis",
    externals=("reference", "base_rate"),
    units={"reference": "deg", "command": "V", "position": "deg", "rate": "deg/s", "base_rate": "deg/s"},
    controller=Controller(
        "controller",
        "command",
        2,
        (),
        None,
        lambda v: {"reference": v["kp"], "position": -v["kp"], "rate": -v["kd"]},
    ),
    chain=(DRIVE,),
    numbers={
        "kp": (0.9, 0.2),
        "kd": (0.06, 0.2),
        "drive.gain": (400.0, 0.2),
        "drive.viscous": (8.0, 0.2),
    },
    tolerances={"drive.viscous": 10, "drive.gain": 5},
    inside_noise={"position": 0.01, "rate": 0.1},
    outside_noise={},
    offers=OFFERS,
    demand_size=(6.0, 30.0),
    text=TEXT,
)
