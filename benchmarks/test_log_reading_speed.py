"""A log of ten million rows and four columns: seconds, and memory against the size of the numbers themselves."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROWS = 10_000_000
READ = """
import resource, sys
from delaytools.measurement.log_file import read_log
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
assert len(read_log(sys.argv[1])) == int(sys.argv[2])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""
BARE = "import numpy, sys; numpy.loadtxt(sys.argv[1], delimiter=',', skiprows=1)"


def write(path: Path) -> None:
    rng, block = np.random.default_rng(0), 100_000
    with path.open("w") as file:
        file.write("time[s],a[deg],b,c\n")
        for first in range(0, ROWS, block):
            t, x = np.arange(first, first + block) * 1e-3, rng.standard_normal((block, 3))
            rows = zip(t.tolist(), x.tolist(), strict=True)
            file.write("".join(f"{a:.3f},{b:.9g},{c:.9g},{d:.9g}\n" for a, (b, c, d) in rows))


def seconds(code: str, path: Path) -> tuple[float, str]:
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code, str(path), str(ROWS)], check=True, capture_output=True, text=True
    )
    return time.perf_counter() - begin, done.stdout


def test_ten_million_rows(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    write(path)
    ours, memory = seconds(READ, path)
    bare, _ = seconds(BARE, path)
    times = int(memory) * 1024 / (ROWS * 4 * 8)
    print(
        f"10^7 rows of 4 columns: {ours:.1f} s, {ours / bare:.2f} of numpy.loadtxt; {times:.2f} times the numbers"
    )
    assert ours < 4 * bare
    assert times < 3.0
