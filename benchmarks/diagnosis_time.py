"""How long a diagnosis takes, how that grows with the log, and where the time goes.

    python -m benchmarks.diagnosis_time [--processes 2] [--cases 12]

Roll benches of the blind benchmark: 20 s at 1 kHz, 6 signals, the whole catalogue; with nothing, one and two effects
missing. Marks: 60 s where at most one is missing, 180 s at worst; three quarters more time at most for twice the rows.
The profile is that of one process, by what the search was doing.
"""

import argparse
import cProfile
import os
import pstats
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.hidden_effects.make import batches, chosen, make

SEED = 5
KINDS = ("none", "single", "double")
PARTS = (0.25, 0.5, 1.0)
STAGES = {  # function -> what it is; times are cumulative, and those indented are parts of others
    "proposals": "candidates screened",
    "screened": "  profiles",
    "modes": "  modes",
    "interferences": "  interferences",
    "transients": "  windows of gain",
    "swings": "  varying delays",
    "quantisations": "  quantisers",
    "fits": "first fits",
    "fitted_again": "fits to the end",
    "noise_of": "noise",
    "segment_report": "report",
    "driven_best": "what drives a segment",
    "compile_loop": "of all: compiling",
    "run_with_derivatives": "of all: runs with derivatives",
}


def prepared(folder: Path) -> tuple[object, list]:
    """Design and log of a case."""
    from delaytools.cli.measured import read_records
    from delaytools.cli.reading import load

    plan, loop, _ = load(str(folder / "bench.toml"), None)
    return plan, read_records(plan, loop, [str(folder / "run.csv")])[0]


def shortened(records: list, part: float) -> list:
    """The first part of each log."""
    from delaytools.signals.record import Record

    def cut(r: Record) -> Record:
        count = int(part * len(r))
        return Record(r.time[:count], {k: v[:count] for k, v in r.columns.items()}, r.units, r.held, r.source)

    return [cut(record) for record in records]


def seconds(work: Callable[[], object]) -> tuple[float, object]:
    """Wall time and answer."""
    begin = time.perf_counter()
    found = work()
    return time.perf_counter() - begin, found


def profile(work: Callable[[], object]) -> list[str]:
    """Lines: cumulative time of each stage."""
    watch = cProfile.Profile()
    watch.runcall(work)
    times: dict[str, float] = {}
    for (file, _, name), (_, _, _, spent, _) in pstats.Stats(watch).stats.items():
        if name in STAGES and f"{os.sep}delaytools{os.sep}" in file:
            times[name] = max(times.get(name, 0.0), spent)
    return [f"    {STAGES[name]:32s} {times.get(name, 0.0):7.1f} s" for name in STAGES]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--cases", type=int, default=12)
    given = parser.parse_args()
    from delaytools.diagnosis.diagnose import Effort, diagnose

    effort, alone = Effort(processes=given.processes), Effort(processes=1)
    with tempfile.TemporaryDirectory() as scratch:
        plan = list(batches(chosen(given.cases, SEED, set(KINDS), "roll")))
        names = sorted(name for numbers in plan for name in make(numbers, SEED, Path(scratch)))
        print(f"{'case':24s} {'rows':>7s} {'seconds':>8s}  verdict")
        for name in names:
            design, records = prepared(Path(scratch) / name)
            took, found = seconds(lambda d=design, r=records: diagnose(d, r, effort=effort))
            said = f"{found.verdict}{' budget exhausted' if found.budget_exhausted else ''}"
            print(f"{name:24s} {len(records[0]):7d} {took:8.1f}  {said}", flush=True)
        for kind in KINDS:
            name = next(n for n in names if f"_{kind}_" in n)
            design, records = prepared(Path(scratch) / name)
            print(f"{name}: seconds by rows")
            for part in PARTS:
                short = shortened(records, part)
                took, _ = seconds(lambda d=design, r=short: diagnose(d, r, effort=effort))
                print(f"    {len(short[0]):7d} {took:8.1f}", flush=True)
            print("  profile, one process")
            print("\n".join(profile(lambda d=design, r=records: diagnose(d, r, effort=alone))), flush=True)


if __name__ == "__main__":
    main()
