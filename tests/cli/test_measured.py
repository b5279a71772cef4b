"""`compare`, `diagnose` and `improve`: the contract's keys, the exit status, what is refused before it is computed."""

import sys
from pathlib import Path
from typing import Any

import pytest

import delaytools.diagnosis.diagnose as diagnosing
from delaytools.design.file import read_design, write_design
from delaytools.measurement.log_file import write_log
from tests.cli.test_journeys import Run, answered, inside, said, strict
from tests.diagnosis.found import DEAD_BAND, DELAY, OPEN, diagnosis
from tests.measurement.bench_logs import bench_design, bench_log

__all__ = ["inside"]
SIGNAL_KEYS = {
    "signal", "unit", "driven_by", "rms_error", "noise_rms", "fit_percent", "theil", "verdict", "worst_times",
    "worst_bands", "worst_levels",
}  # fmt: skip
BAND = {"type": "dead_band", "at": "actuator.input", "half_width": "0.1 deg"}


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the bench, a log that it explains, and one that it does not."""
    path = tmp_path_factory.mktemp("bench")
    write_design(bench_design(), path / "bench.toml")
    write_log(bench_log(duration=6.0), path / "good.csv")
    write_log(bench_log(BAND, duration=6.0), path / "bad.csv")
    return path


def given(monkeypatch: pytest.MonkeyPatch, answer: Any) -> list[dict[str, Any]]:
    """Lets the search give this answer at once; what it was asked is kept."""
    asked: list[dict[str, Any]] = []

    def at_once(design: Any, records: Any, **settings: Any) -> Any:
        asked.append(settings | {"logs": len(records)})
        return answer

    monkeypatch.setattr(diagnosing, "diagnose", at_once)
    return asked


def test_compare_answers_with_the_keys_of_the_contract(inside: Run, home: Path) -> None:
    found = answered(inside, "compare", home / "bench.toml", home / "bad.csv")
    assert [one["signal"] for one in found["signals"]] == ["command", "fin", "rate", "sensed"]
    assert all(set(one) >= SIGNAL_KEYS for one in found["signals"])
    verdicts = {one["signal"]: one["verdict"] for one in found["signals"]}
    assert verdicts == {"command": "adequate", "fin": "fails", "rate": "adequate", "sensed": "adequate"}
    assert "fin fails first" in found["where"] and "block actuator" in found["where"]
    fin = found["signals"][1]
    assert fin["driven_by"] == ["command"] and fin["unit"] == "deg" and len(fin["worst_bands"][0]) == 4


def test_compare_says_it_in_a_table(inside: Run, home: Path) -> None:
    done = inside("compare", home / "bench.toml", home / "good.csv", home / "bad.csv")
    assert done.returncode == 0 and "FAILS" in done.stdout and "closed loop" in done.stdout
    assert done.stderr == ""
    assert inside("compare", home / "bench.toml", home / "bad.csv", "--gate").returncode == 1
    assert inside("compare", home / "bench.toml", home / "good.csv", "--gate").returncode == 0


def test_compare_reads_what_simulate_wrote(inside: Run, home: Path, tmp_path: Path) -> None:
    log = tmp_path / "run.csv"
    assert inside("simulate", home / "bench.toml", "--duration", "3s", "--out", log).returncode == 0
    found = answered(inside, "compare", home / "bench.toml", log)
    assert found["adequate"] and all(one["fit_percent"] > 99.9 for one in found["signals"])


def test_diagnose_answers_with_the_keys_of_the_contract(
    inside: Run, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = given(monkeypatch, diagnosis(DEAD_BAND, DELAY, verdict="unexplained", **OPEN))
    words = (home / "bench.toml", home / "bad.csv", home / "good.csv", "--seed", 3, "--budget", 20)
    found = answered(inside, "diagnose", *words)
    effort = asked[0]["effort"]
    assert effort.seed == 3 and effort.budget == 20 and asked[0]["logs"] == 2
    assert set(found) >= {
        "verdict", "missing", "ranking", "confusable", "ladder", "unexplained", "next_experiment", "budget_exhausted",
        "seconds",
    }  # fmt: skip
    assert found["missing"][0]["parameters"]["half_width"] == {"value": 0.10034, "std": 0.00071, "unit": "deg"}
    assert set(found["ranking"]["sensed"][0]) >= {"effect", "at", "parameters", "held_out_rms", "evidence"}
    assert set(found["confusable"][0]["members"][0]) >= {"effect", "at", "parameters", "delta_chi2"}
    assert set(found["ladder"][0]) == {"step", "errors", "whitened"}
    assert set(found["unexplained"][0]) == {"signal", "share_of_error", "bands", "hint"}
    assert set(found["next_experiment"]) == {"why", "input", "expected_delta_chi2"}


def test_diagnose_says_what_should_be_known(inside: Run, home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given(monkeypatch, diagnosis(DEAD_BAND, DELAY, verdict="unexplained", **OPEN))
    done = inside("diagnose", home / "bench.toml", home / "bad.csv", "--gate")
    assert done.returncode == 1
    for part in (
        "verdict: unexplained", "missing: dead_band@actuator.input (half_width = 0.10034 ± 0.00071 deg)",
        "perhaps missing: delay@gyro.input", "what:", "cause:", "margins:", "check:", "do not tell apart",
        "3 to 9 Hz", "next experiment", "held-out rms error", "as designed",
    ):  # fmt: skip
        assert part in done.stdout, part
    given(monkeypatch, diagnosis())
    assert inside("diagnose", home / "bench.toml", home / "good.csv", "--gate").returncode == 0


def test_improve_writes_a_design_that_meets_the_log(
    inside: Run, home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given(monkeypatch, diagnosis(DEAD_BAND, DELAY))
    out, answer = tmp_path / "new.toml", tmp_path / "answer.json"
    done = inside("improve", home / "bench.toml", home / "bad.csv", "--out", out, "--json", answer)
    assert done.returncode == 0 and "[[effects]]" in done.stdout and "held-out" in done.stdout
    found = strict(answer.read_text())
    assert [one["effect"] for one in found["added"]] == ["dead_band"] and len(found["ladder"]) == 3
    assert found["added"][0]["place"] == "effects.0"
    assert "# fitted to bad.csv on 20" in read_design(out).text
    assert inside("compare", out, home / "bad.csv", "--gate").returncode == 0
    done = inside("improve", home / "bench.toml", home / "bad.csv", "--effect", "delay@gyro.input")
    assert "delay = \"7.012 ms\"" in done.stdout and "give --out FILE" in done.stdout
    given(monkeypatch, diagnosis(DELAY))
    assert "nothing is added" in inside("improve", home / "bench.toml", home / "bad.csv").stdout


def test_the_search_itself_finds_the_dead_band(inside: Run, home: Path) -> None:
    found = answered(inside, "diagnose", home / "bench.toml", home / "bad.csv")
    assert [(one["effect"], one["signal"]) for one in found["missing"]] == [("dead_band", "fin")]


def test_what_is_refused(inside: Run, home: Path, tmp_path: Path) -> None:
    design, log = home / "bench.toml", home / "good.csv"
    cases = {
        ("compare", design): ("Missing argument", "LOG"),
        ("compare", design, home / "none.csv"): ("none.csv", "no such file"),
        ("compare", design, design): ("bench.toml",),
        ("compare", design, log, "--configuration", "x"): ("unknown configuration",),
        ("diagnose", design, log, "--budget", "0"): ("--budget",),
        ("diagnose", design, log, "--seed", "-1"): ("--seed",),
    }
    for words, parts in cases.items():
        message = said(inside(*words))
        for part in parts:
            assert part in message, message


def test_an_unknown_effect_is_refused_with_what_is_known(
    inside: Run, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given(monkeypatch, diagnosis(DEAD_BAND))
    words = ("improve", home / "bench.toml", home / "bad.csv", "--effect", "dead_bnd@actuator.input")
    assert "nearest: dead_band@actuator.input" in said(inside(*words))


@pytest.mark.parametrize("option", ["--json", "--out"])
@pytest.mark.parametrize(
    "command", ["margins", "roots", "simulate", "tune", "compare", "diagnose", "improve", "report"]
)
def test_a_place_that_cannot_be_written_is_noticed_first(
    inside: Run, home: Path, command: str, option: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if option == "--out" and command in ("margins", "roots", "compare", "diagnose"):
        pytest.skip("writes no other file")
    log = [] if command in ("margins", "roots", "simulate", "tune", "report") else [home / "good.csv"]
    monkeypatch.setattr("delaytools.design.file.read_design", lambda path: pytest.fail("computed first"))
    inner = home / "good.csv" / "deep" if command == "report" else home / "no" / "where.json"
    target = inner if option == "--out" else home / "no" / "where.json"
    assert "cannot be written" in said(inside(command, home / "bench.toml", *log, option, target))
    assert not (home / "no").exists()


def test_a_log_in_another_format_is_refused_before_the_run(inside: Run, home: Path) -> None:
    words = ("simulate", home / "bench.toml", "--duration", "20000s", "--out", home / "run.npz")
    assert "logs are written as CSV" in said(inside(*words))


def test_report_holds_the_design_against_logs(
    inside: Run, home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given(monkeypatch, diagnosis(DEAD_BAND))
    found = answered(inside, "report", home / "bench.toml", home / "bad.csv", "--out", tmp_path / "report")
    names = {Path(path).stem for path in found["figures"]}
    assert {"measured_fin", "error_strips", "ladder"} <= names
    given(monkeypatch, None)
    words = ("report", home / "bench.toml", home / "bad.csv", "--no-search", "--out", tmp_path / "plain")
    assert "ladder" not in {Path(path).stem for path in answered(inside, *words)["figures"]}


def test_help_names_the_commands(inside: Run) -> None:
    assert sys.argv
    text = inside("--help").stdout
    assert all(name in text for name in ("compare", "diagnose", "improve"))
