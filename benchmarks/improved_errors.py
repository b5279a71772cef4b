"""After `improve`: is what is left noise, at every signal? Held-out whitened rms with its block-bootstrap band.

    python -m benchmarks.improved_errors CASES [--only TEXT] [--jobs 2]

Each case is diagnosed, the design improved, and the improved design diagnosed against the log again: the first rung of
that ladder with tolerances fitted is the error of what stands in the file. The ladder's unit is what is left at its
end, so that is told beside a measure that knows no model: the held-out error as a multiple of the pick-off's noise by
fourth differences of the column ("-" where that shows none). Signals are marked whose 95 % band does not hold 1, and
those whose multiple is not 1 within the band's width and 3 %, the error of the differences. Unexplained cases are left
out. On the clock of `side_by_side.py`: what else runs on the machine changes nothing.
"""

import argparse
import math
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.hidden_effects.run import PROCESSES
from benchmarks.hidden_effects.side_by_side import side_by_side

Line = tuple[str, float, float, float, float]
DIFFERENCES = 0.03  # two standard errors of a noise level by fourth differences of 20 000 rows


def lines_of(folder: Path) -> tuple[str, list[Line]]:
    """The verdict, and per signal the whitened rms that the improved design leaves, its band, and the multiple."""
    from delaytools.cli.measured import read_records
    from delaytools.cli.reading import load
    from delaytools.diagnosis.diagnose import Effort, diagnose
    from delaytools.diagnosis.improve import improved
    from delaytools.diagnosis.noise_of import column_noise

    plan, loop, _ = load(str(folder / "bench.toml"), None)
    records, _ = read_records(plan, loop, [str(folder / "run.csv")])
    with side_by_side(PROCESSES):
        found = diagnose(plan, records, effort=Effort(processes=PROCESSES))
        if found.verdict == "unexplained":
            return found.verdict, []
        better = improved(plan, found, logs=["run.csv"], date="", values=True)
        again = diagnose(better, records, effort=Effort(processes=PROCESSES))
    place = next((k for k, step in enumerate(again.ladder) if step.step == "tolerances fitted"), 0)
    rung, band = again.ladder[place], again.ladder_bands[place]
    levels = {s: column_noise(records[0][s], s in records[0].held) for s in rung.whitened}
    multiples = {s: rung.errors[s] / level if level > 0 else math.nan for s, level in levels.items()}
    return again.verdict, [(s, white, *band[s], multiples[s]) for s, white in rung.whitened.items()]


def _asked(name: str, only: str) -> bool:
    return any(text in name for text in only.split(","))


def main() -> None:
    """Command line; ends with 1 where a signal is more than noise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    folders = sorted(p for p in given.cases.iterdir() if (p / "bench.toml").exists() and _asked(p.name, given.only))
    outside = 0
    print(f"{'case':8s} {'signal':22s} {'whitened':>9s} {'95 % band':>17s} {'of the noise':>13s}")
    with ProcessPoolExecutor(given.jobs) as pool:
        for folder, (verdict, lines) in zip(folders, pool.map(lines_of, folders), strict=True):
            print(f"{folder.name:8s} {verdict} with what was improved", flush=True)
            for name, white, low, high, multiple in lines:
                far = abs(multiple - 1) > max(high - white, white - low) + DIFFERENCES
                odd = far or not low <= 1.0 <= high
                outside += odd
                told = "-" if math.isnan(multiple) else f"{multiple:.3f}"
                print(f"{'':8s} {name:22s} {white:9.4f} {low:8.4f} {high:8.4f} {told:>13s}{'  <' * odd}", flush=True)
    print(f"signals that are marked: {outside}")
    raise SystemExit(min(outside, 1))


if __name__ == "__main__":
    main()
