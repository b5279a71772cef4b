"""Where effects may act."""

from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.diagnosis.places import spots
from delaytools.loop.segments import segments

CARRIAGE = """
frame = "1 ms"
[signals]
u = "N"
x = "m"
[blocks.drive]
type = "equations"
inputs = { u = "u" }
states = { x = 0.0, v = 0.0 }
rates = { x = "v", v = "(u - 8.0*v)/2.0" }
outputs = { x = "x" }
"""


def test_no_force_acts_where_a_position_follows_its_rate() -> None:
    part = segments(build(parse_design(CARRIAGE)), {"u", "x"})[0]
    found = spots(part)
    assert {str(spot.port) for spot in found if spot.port.kind == "derivative"} == {"drive.v'"}
    assert "cubic_stiffness" in {spot.kind for spot in found}


def test_a_coupling_is_named_where_it_pushes() -> None:
    """At the derivative where the input only adds to it; at both where the block bends what enters."""
    bent = CARRIAGE.replace("(u - 8.0*v)", "(tanh(u) - 8.0*v)")
    for text, places in ((CARRIAGE, {"drive.v'", "drive.x"}), (bent, {"drive.u", "drive.v'", "drive.x"})):
        part = segments(build(parse_design(text)), {"u", "x"})[0]
        assert {str(spot.port) for spot in spots(part) if spot.kind == "cross_coupling"} == places


def test_nothing_is_missing_in_a_signal_that_only_shows_something() -> None:
    shown = CARRIAGE.replace('x = "m"', 'x = "m"\nload = "N"').replace('{ x = "x" }', '{ x = "x", load = "u - 3.0*x" }')
    part = segments(build(parse_design(shown)), {"u", "x"})[0]
    assert {str(spot.port) for spot in spots(part) if spot.port.kind == "output"} == {"drive.x"}
