"""Block diagrams: no box lies on another, no wire runs through a box, every wire ends at its pins."""

from itertools import combinations, pairwise
from pathlib import Path

import pytest

from delaytools.design.design import Design, parse_design
from delaytools.design.file import read_design
from delaytools.report.cases import asked
from delaytools.report.diagram_layout import Box, Diagram, layout
from delaytools.report.diagram_parts import diagram_parts
from tests.report.conftest import REST, SERVO

ROLL = Path(__file__).parents[2] / "designs" / "roll_autopilot.toml"
TURNTABLE = """\
[parameters]
kp = 0.9
kd = 0.06
[blocks.controller]
type = "sample_hold"
input = "kp*(reference - position) - kd*rate"
output = "command"
period = "2 ms"
[blocks.drive]
type = "equations"
inputs = { u = "command" }
states = { q = 0.0, v = 0.0 }
parameters = { gain = 400.0, viscous = 8.0 }
rates = { q = "v", v = "gain*u - viscous*v" }
outputs = { position = "q", rate = "v" }
"""
BRANCHES = SERVO + "".join(
    f'[blocks.monitor_{i}]\ntype = "first_order"\ninput = "{signal}"\noutput = "m{i}"\ntime_constant = "10 ms"\n'
    for i, signal in enumerate(("angle", "angle", "seen", "m0", "rate"))
)
LONG = "".join(
    f'[blocks.stage_{i}]\ntype = "first_order"\ninput = "{"u - 0.1*s14" if i == 0 else f"s{i - 1}"}"\n'
    f'output = "s{i}"\ntime_constant = "10 ms"\n'
    for i in range(15)
)
DESIGNS = {
    "roll": lambda: read_design(ROLL),
    "servo": lambda: parse_design(SERVO + REST),
    "turntable": lambda: parse_design(TURNTABLE),
    "branches": lambda: parse_design(BRANCHES),
    "long": lambda: parse_design(LONG),
}


def drawn(design: Design) -> Diagram:
    return layout(diagram_parts(design), asked(design).at)


def apart(first: Box, second: Box) -> bool:
    across = first.x + first.width <= second.x or second.x + second.width <= first.x
    return (
        across
        or first.y + first.height + first.foot <= second.y
        or second.y + second.height + second.foot <= first.y
    )


@pytest.fixture(params=list(DESIGNS))
def diagram(request: pytest.FixtureRequest) -> Diagram:
    return drawn(DESIGNS[request.param]())


def test_boxes_do_not_overlap_and_lie_on_the_sheet(diagram: Diagram) -> None:
    assert all(apart(a, b) for a, b in combinations(diagram.boxes, 2))
    for box in diagram.boxes:
        assert box.x >= 0 and box.x + box.width <= diagram.width
        assert box.y >= 0 and box.y + box.height <= diagram.height


def test_wires_run_beside_the_boxes(diagram: Diagram) -> None:
    for wire in diagram.wires:
        for line in wire.lines:
            for (x0, y0), (x1, y1) in pairwise(line):
                assert abs(x0 - x1) < 1e-9 or abs(y0 - y1) < 1e-9, f"{wire.signal} runs aslant"
                for box in diagram.boxes:
                    inside_x = max(x0, x1) > box.x + 0.01 and min(x0, x1) < box.x + box.width - 0.01
                    inside_y = max(y0, y1) > box.y + 0.01 and min(y0, y1) < box.y + box.height - 0.01
                    assert not (inside_x and inside_y), f"{wire.signal} runs through {box.part.name}"


def test_every_reader_has_its_wire(diagram: Diagram) -> None:
    written = {signal for box in diagram.boxes for signal in box.part.outputs}
    wanted = {(b.part.name, e.signal) for b in diagram.boxes for e in b.part.entries if e.signal in written}
    ends = {(pin.block, wire.signal) for wire in diagram.wires for pin in wire.readers}
    assert ends == wanted
    for wire in diagram.wires:
        assert all(line[-1] == (pin.x, pin.y) for line, pin in zip(wire.lines, wire.readers, strict=True))


def test_names_of_wires_do_not_lie_on_boxes(diagram: Diagram) -> None:
    for label in diagram.labels:
        for box in diagram.boxes:
            across = label.x + label.width <= box.x + 0.5 or label.x >= box.x + box.width - 0.5
            above = label.y <= box.y + 0.5 or label.y - label.height >= box.y + box.height - 0.5
            assert across or above, f"{label.text!r} lies on {box.part.name}"


def test_signs_ranges_and_effects_are_shown() -> None:
    parts = {part.name: part for part in diagram_parts(read_design(ROLL))}
    assert [(e.signal, e.sign) for e in parts["autopilot"].entries] == [
        ("roll_demand", 1), ("roll_estimate", -1), ("sampled_rate", -1),
    ]  # fmt: skip
    assert parts["motion_table"].bench and "τ = 0 … 15 ms" in parts["motion_table"].lines
    assert not parts["actuator"].bench and parts["actuator"].marks[0].words == "dead band 0.3 deg"
