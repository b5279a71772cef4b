"""A case as files: what the engineers believe, the log, the answer, and everything that is true."""

import json
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.architecture import fill
from benchmarks.hidden_effects.cases import ROWS, Case
from benchmarks.hidden_effects.catalogue import UNKNOWN_FORCE, UNKNOWN_WIRE
from benchmarks.hidden_effects.controller import missed_updates
from benchmarks.hidden_effects.records import Planted

Array = np.ndarray
JUDGED_ONLY = {"flexible_mode": ("frequency",)}  # gain and damping belong to one of several sources


def write(case: Case, logs: dict[str, Array], details: list[dict], folder: Path) -> None:
    """bench.toml, run.csv, answer.json and case.json."""
    place = folder / case.name
    place.mkdir(parents=True, exist_ok=True)
    (place / "bench.toml").write_text(bench_text(case), encoding="utf-8")
    _write_log(case, logs, place / "run.csv")
    answers = [answer(case, effect) for effect in case.planted]
    (place / "answer.json").write_text(json.dumps(answers, indent=1), encoding="utf-8")
    (place / "case.json").write_text(json.dumps(_truth(case, details), indent=1), encoding="utf-8")


def bench_text(case: Case) -> str:
    """The design file: stated numbers and tolerances."""
    bench = case.architecture
    head = f'# {bench.title}: what its engineers believe it to be.\ntitle = "{bench.title}, case k{case.number:04d}"\n'
    text = head + 'frame = "1 ms"\n' + fill(bench.text, case.stated)
    if case.tolerance:
        text += "\n[tolerance]\n" + "".join(
            f'"{path}" = "{share} %"\n' for path, share in case.tolerance.items()
        )
    return text


def _write_log(case: Case, logs: dict[str, Array], path: Path) -> None:
    bench = case.architecture
    columns = {name: case.externals[name] for name in bench.externals[:1]}
    columns |= {name: logs[name] + case.outside.get(name, 0.0) for name in bench.measured}
    columns |= {name: case.externals[name] for name in case.shown if name not in columns}
    header = ",".join(["time[s]", *(f"{name}[{bench.units[name]}]" for name in columns)])
    table = np.stack([np.arange(ROWS) * 1e-3, *columns.values()], axis=1)
    np.savetxt(path, table, fmt=["%.7g"] + ["%.7g"] * len(columns), delimiter=",", header=header, comments="")


def answer(case: Case, effect: Planted) -> dict:
    """One entry of the answer, as the practice cases give it."""
    if effect.effect in UNKNOWN_WIRE + UNKNOWN_FORCE:
        return {"effect": "unknown", "signal": effect.exits[0], "parameters": {}}
    wanted = JUDGED_ONLY.get(effect.effect, tuple(effect.parameters))
    numbers = {k: v for k, v in effect.parameters.items() if k in wanted}
    if effect.effect == "dropped_frames":
        ticks = -(-ROWS // case.architecture.controller.period)
        numbers["probability"] = float(missed_updates(case.draws, numbers["probability"], ticks).mean())
    return {"effect": effect.effect, "signal": effect.exits[0], "parameters": numbers}


def _truth(case: Case, details: list[dict]) -> dict:
    effects = [
        {
            "effect": e.effect,
            "port": e.port,
            "source": e.source,
            "parameters": dict(e.parameters),
            "signals": list(e.exits),
            **detail,
        }
        for e, detail in zip(case.planted, details, strict=True)
    ]
    return {
        "case": case.name,
        "kind": case.kind,
        "architecture": case.architecture.name,
        "seed": case.seed,
        "number": case.number,
        "attempt": case.attempt,
        "effects": effects,
        "stated": dict(case.stated),
        "true": dict(case.truth),
        "tolerance_percent": dict(case.tolerance),
        "noise_before_output_effects": case.noise_first,
        **case.notes,
    }
