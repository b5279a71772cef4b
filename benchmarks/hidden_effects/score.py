"""Was the diagnosis right? One case against its answer, and tables over many.

python -m benchmarks.hidden_effects.score CASES DIAGNOSES, with DIAGNOSES/NAME.json from `delaytools diagnose --json`.
"""

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean, median

NEUTRAL = {"factor": 1.0}
SHARE, STANDARD_ERRORS, TIME, ANGLE = 0.05, 3.0, 0.020, 0.1
COVERING = 1.96
TIMES, ANGLES = ("start", "end"), ("phase",)


@dataclass(frozen=True)
class Verdict:
    """What became of one case.

    right: all rules kept. named: exactly these effects at these signals. inside: every true effect named or in an
    equivalence set. covers: for every judged parameter of a named effect, whether the 95 % interval holds the truth.
    sure: for every effect named as certain, whether it, its port and its source are right. found: for every true effect
    of the catalogue, whether it is named or in an equivalence set. sets: sizes of these. cause: what was judged.
    """

    case: str
    kind: str
    effects: tuple[str, ...]
    right: bool
    named: bool
    certain: bool
    inside: bool
    set_size: int
    covers: tuple[bool, ...]
    sure: tuple[bool, ...]
    found: tuple[bool, ...]
    sets: tuple[int, ...]
    cause: str
    verdict: str
    seconds: float | None
    truth: str
    said: str


def judge(answer: list, diagnosis: dict, log: Path | None = None) -> Verdict:
    """The practice rules; `log` stands beside `case.json`, which knows nominal values and equally right signals."""
    case = _case(log)
    truths = [_with_context(i, entry, case) for i, entry in enumerate(answer)]
    missing = list(diagnosis.get("missing") or [])
    pairs = _pairs(truths, missing)
    unknown = any(t["effect"] == "unknown" for t in truths)
    named = len(pairs) == len(truths) == len(missing)
    verdict = str(diagnosis.get("verdict"))
    if unknown:
        right = named = verdict == "unexplained"
    else:
        expected = "missing" if truths else "adequate"
        right = named and verdict == expected and all(_numbers_right(t, m) for t, m in pairs)
    sets = list(diagnosis.get("confusable") or [])
    found = () if unknown else tuple(_inside(t, missing, sets) for t in truths)
    return Verdict(
        case=str(case.get("case", log.parent.name if log else "")),
        kind=str(case.get("kind", "practice")),
        effects=tuple(e["effect"] for e in case.get("effects", answer)),
        right=right,
        named=named,
        certain=all(m.get("certain", True) for m in missing),
        inside=named if unknown else all(found),
        set_size=max((len(s.get("members", ())) for s in sets), default=len(missing) and 1),
        covers=tuple(c for t, m in pairs for c in _covers(t, m)),
        sure=tuple(_is_sited(m, pairs) for m in missing if m.get("certain", True)),
        found=found,
        sets=(*(len(s.get("members", ())) for s in sets), *(1 for m in missing if m.get("certain", True))),
        cause="unknown" if unknown else "effects" if truths else "none",
        verdict=verdict,
        seconds=diagnosis.get("seconds"),
        truth="; ".join(_words(t["effect"], t["signal"], t["parameters"]) for t in truths) or "nothing",
        said="; ".join(_words(m["effect"], m["signal"], _plain(m)) for m in missing) or "nothing",
    )


def _case(log: Path | None) -> dict:
    beside = log.parent / "case.json" if log else None
    return json.loads(beside.read_text(encoding="utf-8")) if beside and beside.exists() else {}


def _with_context(index: int, entry: Mapping, case: Mapping) -> dict:
    """The answer's entry with its equally right signals and the stated value of a changed parameter."""
    full = {"signals": [entry["signal"]], "nominal": {}, **entry}
    if not case:
        twins = {"position": ["position", "rate"]}
        full["signals"] = twins.get(entry["signal"], [entry["signal"]])
        return full
    truth = case["effects"][index]
    full |= {"signals": truth["signals"], "port": truth["port"], "source": truth["source"]}
    for name in entry["parameters"]:
        path = f"{truth['port']}.{name}"
        if entry["effect"].startswith("parameter_change") and path in case["stated"]:
            full["nominal"] = {name: case["stated"][path]}
    return full


def _same(truth: Mapping, effect: str, signal: str) -> bool:
    return truth["effect"] == effect and signal in truth["signals"]


def _pairs(truths: Sequence[Mapping], missing: Sequence[Mapping]) -> list[tuple[Mapping, Mapping]]:
    left, pairs = list(missing), []
    for truth in truths:
        found = [m for m in left if _same(truth, m["effect"], m["signal"])]
        found.sort(key=lambda m, t=truth: not _numbers_right(t, m))
        if found:
            pairs.append((truth, found[0]))
            left.remove(found[0])
    return pairs


def _is_sited(said: Mapping, pairs: Sequence[tuple[Mapping, Mapping]]) -> bool:
    """Whether a named effect is a true one, at its port, or one at which it would do just the same, with its source."""
    truth = next((t for t, m in pairs if m is said), None)
    if truth is None:
        return False
    ports = (said.get("at"), *(said.get("also_at") or ()))
    source = (said.get("settings") or {}).get("source")
    return truth.get("port") in (None, *ports) and truth.get("source") in (None, source)


def _inside(truth: Mapping, missing: Sequence[Mapping], sets: Sequence[Mapping]) -> bool:
    if any(_same(truth, m["effect"], m["signal"]) for m in missing):
        return True
    return any(_same(truth, m["effect"], s["signal"]) for s in sets for m in s.get("members", ()))


def _numbers_right(truth: Mapping, said: Mapping) -> bool:
    return all(_right(truth, said, name) for name in truth["parameters"])


def _right(truth: Mapping, said: Mapping, name: str) -> bool:
    value, std = _estimate(said, name)
    if value is None:
        return False
    off = _off(name, value, truth["parameters"][name])
    neutral = truth["nominal"].get(name, NEUTRAL.get(name, 0.0))
    allowed = max(SHARE * abs(truth["parameters"][name] - neutral), STANDARD_ERRORS * (std or 0.0))
    if name in TIMES:
        allowed = TIME
    if name in ANGLES:
        allowed = ANGLE
    return off <= allowed


def _off(name: str, value: float, true: float) -> float:
    off = value - true
    return abs(math.remainder(off, 2 * math.pi)) if name in ANGLES else abs(off)


def _estimate(said: Mapping, name: str) -> tuple[float | None, float | None]:
    found = (said.get("parameters") or {}).get(name)
    if isinstance(found, Mapping):
        return found.get("value"), found.get("std")
    return found, None


def _covers(truth: Mapping, said: Mapping) -> list[bool]:
    out = []
    for name, true in truth["parameters"].items():
        value, std = _estimate(said, name)
        if value is not None and std:
            out.append(_off(name, value, true) <= COVERING * std)
    return out


def _plain(said: Mapping) -> dict:
    return {name: _estimate(said, name)[0] for name in said.get("parameters") or {}}


def _words(effect: str, signal: str, numbers: Mapping) -> str:
    shown = ", ".join(
        f"{k}={v:.4g}" if isinstance(v, int | float) else f"{k}={v}" for k, v in numbers.items()
    )
    return f"{effect}@{signal}({shown})"


def table(verdicts: Sequence[Verdict]) -> str:
    """Per kind, per effect of the single cases, and every failure with what was said."""
    kinds = list(dict.fromkeys(v.kind for v in verdicts))
    effects = sorted({e for v in verdicts if v.kind == "single" for e in v.effects})
    lines = [_head("kind")]
    lines += [_line(kind, [v for v in verdicts if v.kind == kind]) for kind in kinds]
    lines += [_line("all", verdicts), "", _head("single effect")]
    lines += [_line(e, [v for v in verdicts if v.kind == "single" and e in v.effects]) for e in effects]
    lines += ["", "failures"]
    lines += [f"{v.case}: is {v.truth}; said {v.verdict}: {v.said}" for v in verdicts if not v.right]
    return "\n".join(lines)


def summary(verdicts: Sequence[Verdict]) -> str:
    """What the toolkit promises of its answers, each as a count."""
    none = [v for v in verdicts if v.cause == "none"]
    unknown = [v for v in verdicts if v.cause == "unknown"]
    sets = [n for v in verdicts for n in v.sets]
    sure, found, covers = ([x for v in verdicts for x in getattr(v, key)] for key in ("sure", "found", "covers"))
    lines = [
        ("named as certain: name, port and source right", sum(sure), len(sure)),
        ("true effects named or in an equivalence set", sum(found), len(found)),
        ("effect-free benches with an effect named", sum(v.said != "nothing" for v in none), len(none)),
        ("benches outside the catalogue called unexplained", sum(v.right for v in unknown), len(unknown)),
        ("95 % intervals that hold the truth", sum(covers), len(covers)),
    ]
    shown = [f"{words:50s} {count:4d} of {of:4d}  {100 * count / max(of, 1):5.1f} %" for words, count, of in lines]
    size = f"median {median(sets):g}, largest {max(sets)}" if sets else "-"
    return "\n".join([*shown, f"{'sizes of equivalence sets':50s} {size}"])


def _head(first: str) -> str:
    return (
        f"{first:34s} {'n':>4s} {'right':>6s} {'named':>6s} {'inside':>6s} {'set':>5s} {'95 %':>6s} {'s':>7s}"
    )


def _line(name: str, some: Sequence[Verdict]) -> str:
    covers = [c for v in some for c in v.covers]
    seconds = [v.seconds for v in some if v.seconds is not None]
    share = f"{mean(covers):6.2f}" if covers else "     -"
    time = f"{median(seconds):7.1f}" if seconds else "      -"
    counts = [sum(getattr(v, key) for v in some) for key in ("right", "named", "inside")]
    size = mean(v.set_size for v in some) if some else 0.0
    return (
        f"{name:34s} {len(some):4d} {counts[0]:6d} {counts[1]:6d} {counts[2]:6d} {size:5.2f} {share} {time}"
    )


def print_tables(cases: Path, diagnoses: Path) -> None:
    """The tables over all cases of a folder that have a diagnosis."""
    verdicts = []
    for folder in sorted(p for p in cases.iterdir() if (p / "answer.json").exists()):
        said = diagnoses / f"{folder.name}.json"
        if said.exists():
            answer = json.loads((folder / "answer.json").read_text(encoding="utf-8"))
            verdicts.append(judge(answer, json.loads(said.read_text(encoding="utf-8")), folder / "run.csv"))
    print(table(verdicts), "", summary(verdicts), sep="\n")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path)
    parser.add_argument("diagnoses", type=Path)
    given = parser.parse_args()
    print_tables(given.cases, given.diagnoses)


if __name__ == "__main__":
    main()
