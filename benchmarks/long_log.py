"""A log of ten million rows through read, compare and diagnose: seconds and memory of each; run by hand.

    python -m benchmarks.long_log [ROWS] > benchmarks/results/long_log_DATE.txt

The log is a simulated run of an actuator with a dead band and a sensor, written to a temporary directory.
"""

import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from delaytools.design.build import build
from delaytools.design.design import Design, parse_design
from delaytools.design.edit import with_effect
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.measurement.compare import compare
from delaytools.measurement.log_file import Columns, read_log
from delaytools.signals.stimulus import Multisine
from delaytools.simulation.simulate import simulate

ROWS = 10_000_000
PART = 200_000  # rows simulated and written at a time
STEP = 1e-3  # s
NOISE = {"fin": 0.01, "sensed": 0.02}
DESIGN = """
frame = "1 ms"
[signals]
command = "deg"
fin = "deg"
sensed = "deg"
[blocks.actuator]
type = "second_order"
input = "command"
output = "fin"
natural_frequency = "90 rad/s"
damping = 0.6
[blocks.sensor]
type = "first_order"
input = "fin"
output = "sensed"
time_constant = "5 ms"
"""


def write_long_log(path: Path, design: Design, rows: int) -> None:
    """A run from rest, then its steady part again and again, with new noise each time."""
    loop = build(with_effect(design, {"type": "dead_band", "at": "actuator.input", "half_width": "0.1 deg"}))
    stimulus = Multisine(amplitude=2.0, from_frequency=0.2, to_frequency=12.0, lines=60)  # repeats every 5 s
    run = simulate(loop, {"command": stimulus}, duration=2 * PART * STEP).record
    draw = np.random.default_rng(1)
    with path.open("w", encoding="ascii") as file:
        file.write("time[s],command[deg],fin[deg],sensed[deg]\n")
        for first in range(0, rows, PART):
            part = np.arange(min(PART, rows - first)) + (PART if first else 0)
            noisy = [run[n][part] + size * draw.standard_normal(len(part)) for n, size in NOISE.items()]
            time = STEP * (first + np.arange(len(part)))
            np.savetxt(file, np.column_stack([time, run["command"][part], *noisy]), "%.9g", ",")


def measured(what: str, work: Callable[[], Any]) -> Any:
    """The answer of some work; prints its seconds and the largest memory of this process so far."""
    begin = time.perf_counter()
    answer = work()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{what:10s} {time.perf_counter() - begin:7.1f} s   most memory so far {memory:5.2f} GB", flush=True)
    return answer


def main() -> None:
    """Make the log, send it through the chain, print."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else ROWS
    design = parse_design(DESIGN)
    with tempfile.TemporaryDirectory() as home:
        path = Path(home) / "long.csv"
        measured("write", lambda: write_long_log(path, design, rows))
        print(f"{rows} rows, {path.stat().st_size / 1e6:.0f} MB of CSV")
        record = measured("read", lambda: read_log(path, Columns(units=build(design).units)))
    found = measured("compare", lambda: compare(design, [record]))
    print("   " + "; ".join(f"{one.signal} {one.verdict}" for one in found.signals))
    answer = measured("diagnose", lambda: diagnose(design, [record], effort=Effort(processes=1)))
    for one in answer.missing:
        values = ", ".join(f"{n} {q.value:.5g} ± {q.std:.2g} {q.unit}" for n, q in one.parameters.items())
        print(f"   {answer.verdict}: {one.effect}@{one.at} {values}; certain: {one.certain}")
    print(f"   budget exhausted: {answer.budget_exhausted}; notes: {'; '.join(answer.notes) or 'none'}")


if __name__ == "__main__":
    main()
