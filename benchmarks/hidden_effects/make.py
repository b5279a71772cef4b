"""python -m benchmarks.hidden_effects.make OUT_DIR --cases 320 --seed 1: writes benches with hidden effects."""

import argparse
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.hidden_effects.cases import architecture_of
from benchmarks.hidden_effects.kinds import MIX, kind_of
from benchmarks.hidden_effects.sizing import solve
from benchmarks.hidden_effects.writing import write

BATCH = 90


def chosen(count: int, seed: int, kinds: set[str], architecture: str | None) -> list[tuple[int, str]]:
    """Numbers and benches of the first `count` cases that are asked for."""
    found: list[tuple[int, str]] = []
    for number in range(1, 100 * count + 1):
        if len(found) == count:
            break
        bench = architecture_of(number, seed).name
        if kind_of(number, seed)[0] in kinds and architecture in (None, bench):
            found.append((number, bench))
    return found


def batches(cases: list[tuple[int, str]]) -> Iterator[list[int]]:
    """Cases of one bench, some at a time."""
    for bench in sorted({bench for _, bench in cases}):
        numbers = [number for number, other in cases if other == bench]
        parts = -(-len(numbers) // BATCH)
        yield from (numbers[i::parts] for i in range(parts))


def make(numbers: list[int], seed: int, folder: Path) -> list[str]:
    """Solve and write some cases of one bench."""
    names = []
    for case, logs, details in solve(numbers, seed):
        write(case, logs, details, folder)
        names.append(case.name)
    return names


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=320)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(MIX))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--architecture", default=None)
    given = parser.parse_args()
    plan = list(batches(chosen(given.cases, given.seed, set(given.kinds.split(",")), given.architecture)))
    with ProcessPoolExecutor(given.jobs) as pool:
        waiting = [pool.submit(make, numbers, given.seed, given.folder) for numbers in plan]
        for job in waiting:
            print(*job.result(), sep="\n", flush=True)


if __name__ == "__main__":
    main()
