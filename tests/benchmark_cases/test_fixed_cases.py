"""A small fixed set of the blind benchmark: logs of its truth simulator, cut to a few seconds, answered right."""

import json
from pathlib import Path

import pytest

from benchmarks.hidden_effects.score import judge
from delaytools.cli.measured import read_records
from delaytools.cli.reading import load
from delaytools.diagnosis.diagnose import Effort, diagnose

CASES = sorted((Path(__file__).parent / "logs").iterdir())


@pytest.mark.parametrize("folder", CASES, ids=[case.name for case in CASES])
def test_the_hidden_effect_is_named(folder: Path) -> None:
    plan, loop, _ = load(str(folder / "bench.toml"), None)
    records, _ = read_records(plan, loop, [str(folder / "run.csv.gz")])
    found = diagnose(plan, records, effort=Effort(processes=1))
    said = {"verdict": found.verdict, "missing": [vars(one) for one in found.missing], "confusable": []}
    for one in said["missing"]:
        one["parameters"] = {name: vars(value) for name, value in one["parameters"].items()}
    answer = json.loads((folder / "answer.json").read_text(encoding="utf-8"))
    verdict = judge(answer, said, folder / "run.csv.gz")
    assert verdict.right, (verdict.truth, verdict.said, found.verdict)
