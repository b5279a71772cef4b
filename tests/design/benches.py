"""A small bench as a design file, and ways to spoil it."""

from delaytools.design.build import build, check_paths, flight
from delaytools.design.design import Design, parse_design
from delaytools.loop.loop import Loop

BENCH = """\
title = "Small roll bench"
frame = "1 ms"

[parameters]
kp = 0.045

[signals]
demand = "deg"
fin_command = "deg"
fin = "deg"
rate = "deg/s"

[blocks.autopilot]
type = "sample_hold"
input = "demand - kp*rate"
output = "fin_command"
period = "5 ms"

[blocks.actuator]
type = "second_order"
input = "fin_command"
output = "fin"
natural_frequency = "180 rad/s"
damping = 0.6

[blocks.airframe]
type = "transfer_function"
input = "fin"
output = "rate"
numerator = [900.0]
denominator = [1.0, 2.0]
"""

DRIVE = """
[blocks.drive]
type = "equations"
inputs = { u = "rate" }
states = { q = 0.0, v = 0.0 }
parameters = { mass = 95.1, viscous = 203.5 }
rates = { q = "v", v = "(u - viscous*v)/mass" }
outputs = { position = "q" }
"""


def spoilt(old: str, new: str, text: str = BENCH) -> str:
    """The bench with one piece of text replaced; the piece must be there once."""
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the bench"
    return text.replace(old, new)


def loaded(text: str, configuration: str | None = None) -> tuple[Design, Loop]:
    """What a command does before it computes anything: read, build, check every table."""
    design = parse_design(text, "bench.toml")
    loop = build(design, configuration)
    check_paths(design, loop)
    flight(design, configuration)
    return design, loop


def effect(*lines: str) -> str:
    """The bench with one effect."""
    return BENCH + "\n[[effects]]\n" + "\n".join(lines) + "\n"
