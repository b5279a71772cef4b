"""A small second-order bench that takes a second to report on, and its report, written once."""

from pathlib import Path

import pytest

from delaytools.design.design import Design, parse_design
from delaytools.report.contents import Contents, gather
from delaytools.report.write import ReportFiles, write_report

SERVO = """\
title = "Servo & <table>"
[parameters]
k = 12.0                     # 1/s, *assumed*
lead = 0.0
[signals]
demand = "deg"
angle = "deg"
late_angle = "deg"
seen = "deg"
rate = "deg/s"
[blocks.controller]
type = "gain"
input = "k*(demand - seen)"
output = "rate"
[blocks.axis]
type = "integrator"
input = "rate"
output = "angle"
[blocks.table]
type = "delay"
input = "angle"
output = "late_angle"
delay = "20 ms"              # Smith 1999, table 3
[blocks.sensor]
type = "second_order"
input = "late_angle + lead*rate"
output = "seen"
natural_frequency = "200 rad/s"
damping = 0.7
"""
REST = """
[configurations.slow]
set = { "table.delay" = "60 ms" }
[configurations.compensated]
extend = "slow"
set = { "parameters.lead" = 0.03 }
[configurations.lost]
set = { "table.delay" = "300 ms" }
[inputs]
demand = { type = "step", amplitude = "2 deg" }
[simulation]
duration = "3 s"
[analysis]
at = "rate"
delay_at = "table.input"
[flight]
remove = ["table"]
[tuning]
vary = { lead = [0.0, 0.1] }
"""


@pytest.fixture(scope="session")
def servo() -> Design:
    return parse_design(SERVO + REST, "servo.toml")


@pytest.fixture(scope="session")
def contents(servo: Design) -> Contents:
    return gather(servo, lambda _: None)


@pytest.fixture(scope="session")
def written(servo: Design, tmp_path_factory: pytest.TempPathFactory) -> tuple[ReportFiles, list[str]]:
    said: list[str] = []
    out: Path = tmp_path_factory.mktemp("servo") / "report"
    return write_report(servo, out, progress=said.append), said
