"""python -m benchmarks.hidden_effects.practice FOLDER: the truth simulator against practice logs of another simulator.

Every segment is run from its measured input with the true effect in it; what remains at its exit must be noise.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter

from benchmarks.hidden_effects.architecture import Architecture
from benchmarks.hidden_effects.records import Lane, Planted
from benchmarks.hidden_effects.roll import ROLL
from benchmarks.hidden_effects.servo import SERVO
from benchmarks.hidden_effects.simulator import simulate

Array = np.ndarray


def _one(effect: str, port: str, **numbers: float) -> Planted:
    return Planted(effect, port, numbers, ())


KNOWN: dict[str, tuple[Architecture, Sequence[Planted]]] = {
    "p01": (ROLL, [_one("delay", "motion_table.input", delay=0.015)]),
    "p02": (ROLL, [_one("dead_band", "actuator.input", half_width=0.3)]),
    "p03": (ROLL, []),
    "p04": (ROLL, [_one("parameter_change:natural_frequency", "actuator", natural_frequency=157.0)]),
    "p05": (ROLL, [_one("coulomb_friction", "actuator.rate'", level=2500.0)]),
    "p06": (ROLL, [_one("constant_disturbance", "airframe.output'", level=40.0)]),
    "p07": (
        ROLL,
        [
            _one("delay", "motion_table.input", delay=0.012),
            _one("dead_band", "actuator.input", half_width=0.25),
        ],
    ),
    "p08": (
        ROLL,
        [_one("periodic_interference", "gyro.output", amplitude=1.5, frequency=60.0, phase=0.7006)],
    ),
    "p09": (SERVO, [_one("coulomb_friction", "drive.v'", level=40.0), _one("delay", "drive.u", delay=0.005)]),
    "p11": (SERVO, []),
    "p12": (ROLL, [_one("dead_band", "actuator.input", half_width=0.03)]),
    "p13": (
        ROLL,
        [
            _one("parameter_change:natural_frequency", "actuator", natural_frequency=163.0),
            _one("backlash", "actuator.input", half_width=0.1),
        ],
    ),
}
NOISE = {"fin_command": 0.0, "fin_position": 0.01, "roll_rate": 0.0, "table_rate": 0.05, "sensed_rate": 0.05}
NOISE |= {"command": 0.0, "position": 0.01, "rate": 0.1}


def residuals(folder: Path, case: str, rows: int | None = None) -> dict[str, Array]:
    """Measured minus simulated, segment by segment, over the first rows."""
    bench, effects = KNOWN[case]
    log = {name: column[:rows] for name, column in read_log(folder / case / "run.csv").items()}
    rows = len(log[bench.controller.command_signal])
    values = {name: x for name, (x, _) in bench.numbers.items()}
    for e in effects:
        if e.effect.startswith("parameter_change"):
            values |= {f"{e.port}.{k}": x for k, x in e.parameters.items()}
    externals = {name: log.get(name, np.zeros(rows)) for name in bench.externals}
    driven = {name: log[name] for name in bench.measured}
    made = simulate(bench, [Lane(values, effects, externals)], rows, driven=driven)
    return {name: log[name] - made[name][:, 0] for name in bench.measured}


def expected(bench: Architecture, signal: str) -> float:
    """Noise rms of a residual: the exit's own and that of the input carried through the block (white, per row)."""
    values = {name: x for name, (x, _) in bench.numbers.items()}
    block = next((b for b in bench.chain if any(o.signal == signal for o in b.outputs)), None)
    if block is None:
        return 0.0
    out = next(o for o in block.outputs if o.signal == signal)
    A, B = block.system(values)
    system = (np.array(A), np.array(B)[:, None], np.atleast_2d(out.C(values)), np.zeros((1, 1)))
    Ad, Bd, Cd, Dd, _ = cont2discrete(system, 1e-3, "foh")
    poles = np.poly(Ad)
    pulse = np.zeros(4000)
    pulse[0] = 1.0
    answer = lfilter(np.poly(Ad - Bd @ Cd) + (Dd[0, 0] - 1) * poles, poles, pulse)
    return float(np.hypot(NOISE[signal], NOISE[block.input] * np.sqrt(np.sum(answer**2))))


def read_log(path: Path) -> dict[str, Array]:
    """Columns of a log by signal name."""
    with path.open(encoding="utf-8") as file:
        names = [column.split("[")[0] for column in file.readline().strip().split(",")]
        table = np.loadtxt(file, delimiter=",")
    return dict(zip(names, table.T, strict=True))


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    for case, (bench, _) in KNOWN.items():
        for signal, rest in residuals(folder, case).items():
            rms = np.sqrt(np.mean(rest**2))
            print(f"{case} {signal:14s} residual {rms:10.4g}  expected noise {expected(bench, signal):10.4g}")


if __name__ == "__main__":
    main()
