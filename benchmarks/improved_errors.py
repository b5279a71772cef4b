"""After `improve`: is what is left noise, at every signal? Held-out whitened rms with its block-bootstrap band.

    python -m benchmarks.improved_errors CASES [--only TEXT] [--jobs 2]

Each case is diagnosed, the design improved, and the improved design diagnosed against the log again: the first rung of
that ladder with tolerances fitted is the error of what stands in the file. Signals whose 95 % band does not hold 1 are
marked. Cases that are `unexplained` on purpose are left out.
"""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

Line = tuple[str, str, float, float, float]


def lines_of(folder: Path) -> tuple[str, list[Line]]:
    """The verdict, and per signal the whitened rms that the improved design leaves, and its band."""
    from delaytools.cli.measured import read_records
    from delaytools.cli.reading import load
    from delaytools.diagnosis.diagnose import Effort, diagnose
    from delaytools.diagnosis.improve import improved

    plan, loop, _ = load(str(folder / "bench.toml"), None)
    records, _ = read_records(plan, loop, [str(folder / "run.csv")])
    effort = Effort(processes=1)
    found = diagnose(plan, records, effort=effort)
    if found.verdict == "unexplained":
        return found.verdict, []
    better = improved(plan, found, logs=["run.csv"], date="", values=True)
    again = diagnose(better, records, effort=effort)
    place = next((k for k, step in enumerate(again.ladder) if step.step == "tolerances fitted"), 0)
    rung, band = again.ladder[place], again.ladder_bands[place]
    return again.verdict, [(folder.name, s, white, *band[s]) for s, white in rung.whitened.items()]


def main() -> None:
    """Command line; ends with 1 where a signal is more than noise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    folders = sorted(p for p in given.cases.iterdir() if (p / "bench.toml").exists() and given.only in p.name)
    outside = 0
    print(f"{'case':8s} {'signal':22s} {'whitened':>9s} {'95 % band':>17s}")
    with ProcessPoolExecutor(given.jobs) as pool:
        for folder, (verdict, lines) in zip(folders, pool.map(lines_of, folders), strict=True):
            print(f"{folder.name:8s} {verdict} with what was improved", flush=True)
            for name, signal, white, low, high in lines:
                held = low <= 1.0 <= high
                outside += not held
                mark = "" if held else "  <"
                print(f"{name:8s} {signal:22s} {white:9.4f} {low:8.4f} {high:8.4f}{mark}", flush=True)
    print(f"signals whose band does not hold 1: {outside}")
    raise SystemExit(min(outside, 1))


if __name__ == "__main__":
    main()
