"""Diagnose every case of a folder, some at a time, and print the judge's tables; what was done before is kept.

python -m benchmarks.hidden_effects.run CASES DIAGNOSES [--jobs 2] [--only TEXT] [--budget 170] [--again]

With `side_by_side.py` what calls the toolkit, as its command line does: design and log in, JSON out; each case on the
clock that the command line's two processes would have to themselves.
"""

import argparse
import contextlib
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.hidden_effects.score import print_tables
from benchmarks.hidden_effects.side_by_side import side_by_side

PROCESSES = 2


def diagnosed(folder: Path, target: Path, budget: float) -> tuple[str, float, str]:
    """Name, seconds, and verdict or what went wrong; the answer is written to the target."""
    from delaytools.cli.answers import write_json
    from delaytools.cli.measured import read_records
    from delaytools.cli.reading import load
    from delaytools.diagnosis.diagnose import Effort, diagnose

    begin = time.process_time()
    try:
        plan, loop, _ = load(str(folder / "bench.toml"), None)
        records, _ = read_records(plan, loop, [str(folder / "run.csv")])
        with side_by_side(PROCESSES):
            answer = diagnose(plan, records, effort=Effort(processes=PROCESSES, budget=budget))
    except Exception as error:  # a case that fails is a figure of the run, not its end
        return folder.name, time.process_time() - begin, f"{type(error).__name__}: {error}"
    write_json({name: getattr(answer, name) for name in answer.__dataclass_fields__}, str(target))
    return folder.name, answer.seconds, answer.verdict


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path)
    parser.add_argument("diagnoses", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="")
    parser.add_argument("--budget", type=float, default=170.0)
    parser.add_argument("--again", action="store_true", help="Also what was diagnosed before.")
    given = parser.parse_args()
    given.diagnoses.mkdir(parents=True, exist_ok=True)
    waiting = []
    with ProcessPoolExecutor(given.jobs) as pool, contextlib.suppress(KeyboardInterrupt):
        for folder in sorted(p for p in given.cases.iterdir() if (p / "answer.json").exists()):
            target = given.diagnoses / f"{folder.name}.json"
            if any(text in folder.name for text in given.only.split(",")) and (given.again or not target.exists()):
                waiting.append(pool.submit(diagnosed, folder, target, given.budget))
        for job in as_completed(waiting):
            name, seconds, verdict = job.result()
            print(f"{name:40s} {seconds:7.1f} s  {verdict}", flush=True)
    print_tables(given.cases, given.diagnoses)


if __name__ == "__main__":
    main()
