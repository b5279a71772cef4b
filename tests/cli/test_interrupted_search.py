"""Ctrl-C during a search keeps what is finished, says what is not, and leaves no process behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import delaytools.diagnosis.diagnose as diagnosing
from delaytools.design.file import write_design
from delaytools.diagnosis.answer import Interrupted
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.measurement.log_file import write_log
from tests.cli.test_journeys import Run, inside, strict
from tests.diagnosis.found import DEAD_BAND, DELAY, diagnosis
from tests.measurement.bench_logs import bench_design, bench_log

__all__ = ["inside"]
BAND = {"type": "dead_band", "at": "actuator.input", "half_width": "0.1 deg"}
COUSINS = Path("/proc/self/task")


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bench")
    write_design(bench_design(), path / "bench.toml")
    write_log(bench_log(BAND, duration=6.0), path / "run.csv")
    return path


def test_finished_segments_are_kept() -> None:
    def enough(words: str, share: float) -> None:
        if words == "fin done":
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as caught:
        diagnose(bench_design(), [bench_log(BAND, duration=4.0)], effort=Effort(processes=1), progress=enough)
    answer = caught.value.answer
    assert answer.interrupted and answer.verdict == "missing"
    assert [one.effect for one in answer.missing] == ["dead_band"] and set(answer.ladder[-1].errors) >= {"fin"}
    (said,) = (note for note in answer.notes if note.startswith("interrupted"))
    assert "sensed" in said and "fin" not in said


@pytest.mark.parametrize("command", ["diagnose", "improve"])
def test_what_is_finished_is_written(
    inside: Run, home: Path, tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = diagnosis(DEAD_BAND, DELAY, interrupted=True, notes=("interrupted: not searched at rate",))

    def cut_short(*asked: object, **settings: object) -> None:
        raise Interrupted(found)

    monkeypatch.setattr(diagnosing, "diagnose", cut_short)
    out, answer = tmp_path / "new.toml", tmp_path / "answer.json"
    more = ("--out", out, "--effect", "lag@gyro.output") if command == "improve" else ()
    done = inside(command, home / "bench.toml", home / "run.csv", "--json", answer, *more)
    assert done.returncode == 130 and done.stderr.strip() == "delaytools: interrupted"
    written = strict(answer.read_text())
    assert written["interrupted"] is True and written["notes"] == ["interrupted: not searched at rate"]
    kept = written["missing" if command == "diagnose" else "added"]
    assert kept[0]["effect"] == "dead_band" and not out.exists()


@pytest.mark.skipif(not COUSINS.exists(), reason="processes are counted in /proc")
def test_an_interrupt_from_the_terminal_ends_every_process(home: Path, tmp_path: Path) -> None:
    answer = tmp_path / "answer.json"
    line = [sys.executable, "-m", "delaytools.cli", "diagnose", home / "bench.toml", home / "run.csv", "--json", answer]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    child = subprocess.Popen([str(word) for word in line], start_new_session=True, **streams)
    workers = Path(f"/proc/{child.pid}/task/{child.pid}/children")
    while len(workers.read_text().split()) < 3:  # two workers and the tracker of their resources
        assert child.poll() is None
        time.sleep(0.02)
    time.sleep(0.3)
    os.killpg(child.pid, signal.SIGINT)
    out, err = child.communicate(timeout=60)
    assert child.returncode == 130 and err.strip() == "delaytools: interrupted", (child.returncode, out, err)
    written = strict(answer.read_text())
    assert written["interrupted"] is True and "not searched at" in written["notes"][-1]
    assert _gone(child.pid)


def _gone(group: int, patience: float = 10.0) -> bool:
    """Whether every process of a group ends."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False
