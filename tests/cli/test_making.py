"""Journeys through `tune`, `fit` and `report`: the contract's keys, the files, the exit status."""

import json
import subprocess
import sys
from pathlib import Path

ROLL = Path(__file__).parents[2] / "designs" / "roll_autopilot.toml"


def delaytools(*words: str) -> subprocess.CompletedProcess[str]:
    """One command, run as a user runs it."""
    return subprocess.run(
        [sys.executable, "-m", "delaytools.cli", *words], capture_output=True, text=True, timeout=250, check=False
    )


def test_tune_writes_a_design_that_is_better(tmp_path: Path) -> None:
    out = tmp_path / "tuned.toml"
    done = delaytools("tune", str(ROLL), "--out", str(out), "--json", "-", "--gate")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert set(answer["tuned"]) == {"parameters.alpha", "parameters.K_con"}
    assert all({"value", "was"} <= set(entry) for entry in answer["tuned"].values())
    assert [goal["goal"] for goal in answer["goals"]] == ["band_error", "noise_gain", "phase_margin"]
    assert answer["cost"] < 0.1 * answer["was_cost"]
    assert out.read_text().startswith(ROLL.read_text())
    after = delaytools("margins", str(out), "--configuration", "tuned", "--json", "-")
    before = delaytools("margins", str(ROLL), "--configuration", "complete_hils", "--json", "-")
    phase = [json.loads(run.stdout)["margins"][0]["phase_margin"] for run in (before, after)]
    assert phase[1] > 5 * phase[0]


def test_fit_finds_the_actuator_of_a_run(tmp_path: Path) -> None:
    log = tmp_path / "run.csv"
    delaytools("simulate", str(ROLL), "--configuration", "all_digital", "--duration", "3s", "--out", str(log))
    done = delaytools("fit", str(log), "--input", "fin_command", "--output", "fin_position", "--json", "-")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert {"numerator", "denominator", "natural_frequency", "damping", "delay", "std"} <= set(answer)
    assert abs(answer["natural_frequency"] - 180.0) < 0.2
    assert abs(answer["damping"] - 0.6) < 1e-3


def test_fit_of_an_unknown_signal_is_said(tmp_path: Path) -> None:
    log = tmp_path / "run.csv"
    delaytools("simulate", str(ROLL), "--duration", "1s", "--out", str(log))
    done = delaytools("fit", str(log), "--input", "fin_comand", "--output", "fin_position")
    assert done.returncode == 2
    assert "nearest: fin_command" in done.stderr
    assert "Traceback" not in done.stderr


def test_report_names_its_files(tmp_path: Path) -> None:
    done = delaytools("report", str(ROLL), "--no-tuning", "--out", str(tmp_path), "--json", "-")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert {Path(page).name for page in answer["pages"]} == {"report.html", "report.pdf"}
    assert all(Path(name).exists() for name in (*answer["pages"], *answer["figures"]))
