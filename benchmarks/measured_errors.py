"""Measured logs against their textbook designs: what is named, and the error before and after, beside published ones.

python -m benchmarks.measured_errors [FOLDER] [SET ...] with the logs' folder (default ../shared/measured).
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from delaytools.design.build import build
from delaytools.design.design import Design, parse_design
from delaytools.diagnosis.answer import Diagnosis, Missing
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.loop.network import network
from delaytools.loop.values import resolve
from delaytools.measurement.log_file import Columns, read_log
from delaytools.signals.record import Record

ROOT = Path(__file__).resolve().parents[1]
LOGS = ROOT.parent / "shared" / "measured"
BUDGET = 900.0  # s


@dataclass(frozen=True)
class MeasuredSet:
    """A design and its logs: `pattern` in the folder; signal whose error is judged, times `scale` in `unit`.

    configuration: of a log, by its name. rows: of a log that are used. every: rows whose mean is taken as one.
    published: errors before and after, in the publication's own measure.
    """

    design: str
    pattern: str
    signal: str
    scale: float
    unit: str
    published: str
    configuration: Callable[[str], str | None] = lambda name: None
    rows: int = 100_000
    every: int = 1


SETS = {
    "emps": MeasuredSet(
        "emps", "emps/*.csv", "position", 1e3, "mm",
        "5.53 (linear) -> 2.64 mm (best), free run of another record; ours pieces of 0.5 s", rows=12420, every=5,
    ),
    "silverbox": MeasuredSet(
        "silverbox", "silverbox/*.csv.gz", "output_voltage", 1e3, "mV",
        "7.4 (linear) -> 0.40 mV (cubic), 0.36 mV (best), on a multisine", rows=4096,
    ),
    "daisy_dryer": MeasuredSet(
        "daisy_dryer", "daisy_dryer/*.csv", "outlet_temperature", 1.0, "V",
        "fit 42.9 % (no dead time) -> 88.8 % (3 samples)",
    ),
    "dart_car": MeasuredSet(
        "dart_car", "dart_car/sine_*.csv", "yaw_rate", 1.0, "rad/s",
        "steering angle 0.0477 -> 0.0392 (lag), 0.0394 rad (delay)",
    ),
    "bam_xl330": MeasuredSet(
        "bam_xl330", "bam_xl330/*.csv", "position", 1e3, "mrad",
        "mean abs. 66.8 (Coulomb) -> 56.2 (load) -> 39.2 (gain), whole runs; ours rms of 0.5 s pieces",
        lambda name: f"gain_{name.partition('_kp')[2][:3]}",
    ),
}  # fmt: skip


def logs_of(design: Design, one: MeasuredSet, folder: Path) -> dict[str, Record]:
    """The logs of a set by file name, none longer than `rows`, `every` rows as one."""
    loop = build(design)
    columns = Columns("time", {}, dict(loop.units), network(resolve(loop)).held_signals)
    return {path.name: _first(read_log(path, columns), one) for path in sorted(folder.glob(one.pattern))}


def _first(log: Record, one: MeasuredSet) -> Record:
    """Means over `every` rows: of an input and of a linear answer to it alike, so that they still belong together."""
    count = min(one.rows, len(log)) // one.every * one.every
    time, *values = (x[:count].reshape(-1, one.every).mean(axis=1) for x in (log.time, *log.columns.values()))
    columns = dict(zip(log.columns, values, strict=True))
    return Record(time - time[0] + log.time[0], columns, log.units, log.held, log.source)


def design_of(one: MeasuredSet) -> Design:
    """The set's design, its frame as long as the rows are apart."""
    text = (ROOT / "designs" / "measured" / f"{one.design}.toml").read_text(encoding="utf-8")
    return parse_design(text.replace('frame = "1 ms"', f'frame = "{one.every} ms"'))


def diagnosed(
    one: MeasuredSet, folder: Path, *, budget: float = BUDGET
) -> tuple[Diagnosis, dict[str, Record]]:
    """What the set's design lacks, and the logs by name; one process, the judged signal alone."""
    design = design_of(one)
    logs = logs_of(design, one, folder)
    effort = Effort(processes=1, budget=budget, signals=(one.signal,))
    each = [one.configuration(name) for name in logs]
    return diagnose(design, list(logs.values()), configuration=each, effort=effort), logs


def _named(one: Missing) -> str:
    values = ", ".join(
        f"{n} {q.value:.4g} ± {q.std:.1g} {q.unit}".rstrip() for n, q in one.parameters.items()
    )
    return f"{one.effect}@{one.at} ({values})" + ("" if one.certain else ", not certain")


def lines_of(name: str, one: MeasuredSet, folder: Path) -> list[str]:
    """The row of a set, and below it every rung of its ladder."""
    found, logs = diagnosed(one, folder)
    level = np.concatenate([log[one.signal] for log in logs.values()])
    spread = one.scale * float(np.std(level))
    rungs = [
        (step.step, one.scale * step.errors[one.signal]) for step in found.ladder if one.signal in step.errors
    ]
    before = next((error for step, error in rungs if step == "tolerances fitted"), rungs[0][1])
    after = rungs[-1][1]
    effects = "; ".join(_named(m) for m in found.missing) or "nothing"
    rows = [
        f"{name}: {found.verdict}: {effects}",
        f"  before {before:.4g} {one.unit} (fit {100 * (1 - before / spread):.1f} %), "
        f"after {after:.4g} {one.unit} (fit {100 * (1 - after / spread):.1f} %); published: {one.published}",
        *(f"    {step}: {error:.4g} {one.unit}" for step, error in rungs),
    ]
    for group in found.confusable:
        rows.append("  not told apart: " + ", ".join(f"{m.effect}@{m.at}" for m in group.members))
    return [*rows, f"  {found.seconds:.0f} s"]


def main(words: Sequence[str]) -> None:
    """Prints the table; `words`: the folder, and names of sets (all where none is named)."""
    folder = Path(words[0]) if words and words[0] not in SETS else LOGS
    print("errors on data not used for the fit, rms; before: tolerances fitted, after: with what is named")
    for name in [word for word in words if word in SETS] or list(SETS):
        print("\n".join(lines_of(name, SETS[name], folder)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
