"""Cost of exact answers against delay count, state count and record length, beside other tools in the same run.

    python -m benchmarks.analysis_scaling [--most 1000] [--out FOLDER]

Margins: python-control with Padé approximants of order 10. Roots: tdcpy. Step responses: SciPy (method of steps, dense
output) and JiTCDDE (its compilation apart), both at rtol 1e-9, with their largest error beside the exact response.
What is not installed is left out, and said. Marks: 1000 delays 50 times faster than Padé.
"""

import argparse
import os
from collections.abc import Callable
from contextlib import chdir
from importlib import import_module
from logging import CRITICAL, getLogger
from pathlib import Path
from tempfile import mkdtemp
from time import perf_counter
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import control
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from scipy.integrate import solve_ivp

from delaytools.analysis.characteristic_roots import rightmost_roots
from delaytools.analysis.delay_sweep import sweep_margins
from delaytools.analysis.time_response import step_response
from delaytools.linear.algebra import delay, feedback, from_delay_differential
from delaytools.linear.delay_system import as_delay_system

DENOMINATOR = np.polymul([1.0, 17.86, 14050.0], [0.5, 1.0])
K, TAU = 3.0, 0.020
PLANT = control.tf([K * 14050.0], DENOMINATOR)
COUNTS, STATES, LENGTHS = (10, 30, 100, 300, 1000), (2, 4, 8, 16, 32), (0.5, 1.0, 2.0, 5.0, 10.0)
RTOL, STEP, FASTER = 1e-9, 1e-3, 50
Curve = tuple[list[float], list[float]]


def seconds(run: Callable[[], Any], repeats: int = 3) -> float:
    """The least of some runs."""
    found = []
    for _ in range(repeats):
        begin = perf_counter()
        run()
        found.append(perf_counter() - begin)
    return min(found)


def tool(name: str) -> Any:
    """A module, or None where it is not there."""
    try:
        return import_module(name)
    except ImportError:
        print(f"  {name} is not installed: left out")
        return None


def margins_against_delays(most: int) -> dict[str, Curve]:
    """Seconds for so many delays."""
    L, counts = as_delay_system(PLANT), [n for n in COUNTS if n <= most]

    def padded(delays: np.ndarray) -> list[Any]:
        return [control.stability_margins(PLANT * control.tf(*control.pade(tau, 10))) for tau in delays]

    spans = {n: np.linspace(5e-3, 50e-3, n) for n in counts}
    ours = [seconds(lambda n=n: sweep_margins(L, spans[n]).margins) for n in counts]
    theirs = [seconds(lambda n=n: padded(spans[n]), 1) for n in counts]
    for n, a, b in zip(counts, ours, theirs, strict=True):
        print(f"margins, {n:5d} delays: exact {1e3 * a:8.1f} ms   Padé 10 {1e3 * b:9.1f} ms   ratio {b / a:6.1f}")
    return {"delaytools, exact": (counts, ours), "python-control, Padé 10": (counts, theirs)}


def random_system(n: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A stable x' = A x + B x(t - 1), scaled so that the delay matters."""
    rng = np.random.default_rng(seed)
    A, B = rng.standard_normal((n, n)) / np.sqrt(n), rng.standard_normal((n, n)) / np.sqrt(n)
    return A - 1.5 * np.eye(n), 0.8 * B


def roots_against_states() -> dict[str, Curve]:
    """Seconds for all roots right of a line, certified, of systems with so many states."""
    tdcpy = tool("tdcpy")
    getLogger("tdcpy").setLevel(CRITICAL)
    ours, theirs = [], []
    for n in STATES:
        A, B = random_system(n)
        system = from_delay_differential([A, B], [0.0, 1.0])
        line = rightmost_roots(system, count=12).right_of
        found = rightmost_roots(system, right_of=line)
        ours.append(seconds(lambda system=system, line=line: rightmost_roots(system, right_of=line)))
        words = f"roots, {n:3d} states, {len(found.roots):3d} right of {line:7.3f}: certified {found.certified}"
        if tdcpy is None:
            print(f"{words} {1e3 * ours[-1]:8.1f} ms")
            continue
        rdde = tdcpy.RDDE(A=[A, B], hA=[0.0, 1.0])
        other = tdcpy.roots(rdde, r=line)[0]
        theirs.append(seconds(lambda rdde=rdde, line=line: tdcpy.roots(rdde, r=line), 2))
        print(f"{words} {1e3 * ours[-1]:8.1f} ms   tdcpy {len(other):3d} roots {1e3 * theirs[-1]:8.1f} ms   "
              f"ratio {theirs[-1] / ours[-1]:5.1f}")  # fmt: skip
    return {"delaytools, certified": (list(STATES), ours)} | ({"tdcpy": (list(STATES), theirs)} if theirs else {})


def responses_against_length() -> dict[str, Curve]:
    """Seconds for the step response of the loop over so many seconds, 1 kHz."""
    closed = feedback(delay(TAU) * as_delay_system(PLANT))
    plant = control.ss(PLANT)
    A, B, C = (np.asarray(part) for part in (plant.A, plant.B, plant.C))
    jitcdde = tool("jitcdde")
    make = None if jitcdde is None else compiled(jitcdde, A, B, C)
    found: dict[str, Curve] = {"delaytools, exact": ([], []), "SciPy, rtol 1e-9": ([], [])}
    if make is not None:
        found["JiTCDDE, rtol 1e-9"] = ([], [])
    for length in LENGTHS:
        t = np.arange(0, length + STEP / 2, STEP)
        exact = np.asarray(step_response(closed, t).outputs).ravel()
        runs: dict[str, Callable[[], np.ndarray]] = {
            "delaytools, exact": lambda t=t: np.asarray(step_response(closed, t).outputs).ravel(),
            "SciPy, rtol 1e-9": lambda t=t: by_scipy((A, B, C), t),
        }
        if make is not None:
            runs["JiTCDDE, rtol 1e-9"] = lambda t=t: by_jitcdde(make(), (A, C), t)
        words = []
        for name, run in runs.items():
            off = float(np.abs(run() - exact).max())
            found[name][0].append(length)
            found[name][1].append(seconds(run, 2))
            words.append(f"{name} {1e3 * found[name][1][-1]:8.1f} ms (off {off:.0e})")
        print(f"step response, {length:5.1f} s: " + "   ".join(words))
    return found


def by_scipy(parts: tuple[np.ndarray, ...], t: np.ndarray) -> np.ndarray:
    """Delay interval by delay interval, the last one's dense output as history: u = 1 - y(t - τ)."""
    A, B, C = parts
    x, rows, begin = np.zeros(len(A)), [], 0.0
    before: Callable[[float], np.ndarray] = lambda _: np.zeros(len(A))  # noqa: E731
    while begin < t[-1] - 1e-12:
        end = min(begin + TAU, t[-1] + 1e-12)
        late = before

        def rate(s: float, x: np.ndarray, late: Any = late) -> np.ndarray:
            return A @ x + B[:, 0] * (1 - float((C @ late(s - TAU))[0]))

        run = solve_ivp(rate, (begin, end), x, method="DOP853", rtol=RTOL, atol=1e-12, dense_output=True)
        inside = t[(t >= begin - 1e-12) & (t < end - 1e-12)]
        rows.append(run.sol(inside))
        x, before, begin = run.y[:, -1], run.sol, end
    states = np.concatenate([*rows, x[:, None]], axis=1)[:, : len(t)]
    late_rows = np.concatenate([np.zeros(round(TAU / STEP)), (C @ states)[0]])[: len(t)]
    return late_rows


def compiled(jitcdde: Any, A: np.ndarray, B: np.ndarray, C: np.ndarray) -> Callable[[], Any]:
    """The loop as JiTCDDE takes it, compiled once: a solver at rest for each call."""
    n = len(A)
    y, t = jitcdde.y, jitcdde.t
    late = sum(float(C[0, k]) * y(k, t - TAU) for k in range(n))
    rates = [sum(float(A[i, k]) * y(k) for k in range(n)) + float(B[i, 0]) * (1 - late) for i in range(n)]
    home = Path(mkdtemp())
    with chdir(home):  # its compiler reads the project file of the folder it is in
        module = jitcdde.jitcdde(rates, max_delay=TAU, verbose=False).save_compiled(str(home / "loop"))
    return lambda: jitcdde.jitcdde(n=n, module_location=module, max_delay=TAU, delays=[0.0, TAU], verbose=False)


def by_jitcdde(solver: Any, parts: tuple[np.ndarray, ...], t: np.ndarray) -> np.ndarray:
    """A run from rest."""
    A, C = parts
    solver.constant_past(np.zeros(len(A)))
    solver.set_integration_parameters(rtol=RTOL, atol=1e-12, first_step=1e-4, max_step=TAU)
    solver.adjust_diff(shift_ratio=1e-9)
    begun = solver.t
    rows = np.array([solver.integrate(s) if s > begun else np.zeros(len(A)) for s in t])
    y = rows @ C[0]
    return np.concatenate([np.zeros(round(TAU / STEP)), y])[: len(t)]


def draw(parts: dict[str, dict[str, Curve]], out: Path) -> None:
    """One panel for each."""
    figure = Figure(figsize=(10.5, 3.6), layout="constrained")
    for panel, (label, curves) in zip(figure.subplots(1, 3), parts.items(), strict=True):
        for name, (x, y) in curves.items():
            panel.loglog(x, y, "o-", label=name)
        title, panel_label = label.split(": ")
        panel.set_title(title, loc="left", fontsize=9)
        panel.set_xlabel(panel_label)
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.set_xticks(x, [f"{value:g}" for value in x])
        panel.grid(visible=True, which="both", color="#e3e6ea")
        panel.legend(frameon=False, fontsize=8)
    figure.axes[0].set_ylabel("Time (s)")
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "analysis_scaling.svg")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--most", type=int, default=1000, help="Delays of the largest sweep.")
    parser.add_argument("--out", type=Path, default=Path("."), help="Folder for the figure.")
    given = parser.parse_args()
    margins, roots, lengths = margins_against_delays(given.most), roots_against_states(), responses_against_length()
    draw({
        "Margins: delays": margins, "Characteristic roots right of a line: states": roots,
        "Step response at 1 kHz: length (s)": lengths,
    }, given.out)  # fmt: skip
    (_, ours), (_, theirs) = margins.values()
    if given.most >= COUNTS[-1] and theirs[-1] / ours[-1] < FASTER:
        raise SystemExit(f"1000 delays: {theirs[-1] / ours[-1]:.0f} times faster, below the mark of {FASTER}")


if __name__ == "__main__":
    main()
