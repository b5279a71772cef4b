"""Logs that are wrong, short or odd, through compare, diagnose and improve: a message or an answer, no traceback."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from delaytools.design.file import write_design
from delaytools.measurement.log_file import write_log
from tests.cli.test_journeys import Run, inside, said, strict
from tests.measurement.bench_logs import bench_design, bench_log

__all__ = ["inside"]
BAND = {"type": "dead_band", "at": "actuator.input", "half_width": "0.1 deg"}
COMMANDS = ("compare", "diagnose", "improve")
Table = list[list[str]]  # header and rows of cells


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the bench and a good log of it."""
    path = tmp_path_factory.mktemp("logs")
    write_design(bench_design(), path / "bench.toml")
    write_log(bench_log(BAND, duration=4.0), path / "good.csv")
    return path


def cells(home: Path) -> Table:
    return [line.split(",") for line in (home / "good.csv").read_text().splitlines()]


def text(table: Table) -> str:
    return "\n".join(",".join(row) for row in table) + "\n"


def column(table: Table, name: str) -> int:
    return [head.partition("[")[0] for head in table[0]].index(name)


def put(row: int, name: str, value: str) -> Callable[[Table], str]:
    """One cell changed; row 1 is the header."""

    def change(table: Table) -> str:
        table[row - 1][column(table, name)] = value
        return text(table)

    return change


def first(rows: int) -> Callable[[Table], str]:
    return lambda table: text(table[: rows + 1])


def without(*names: str) -> Callable[[Table], str]:
    def change(table: Table) -> str:
        kept = [k for k, head in enumerate(table[0]) if head.partition("[")[0] not in names]
        return text([[row[k] for k in kept] for row in table])

    return change


def headed(old: str, new: str) -> Callable[[Table], str]:
    return lambda table: text(table).replace(old, new, 1)


def standing(value: str) -> Callable[[Table], str]:
    return lambda table: text([table[0], *([row[0], *[value] * (len(row) - 1)] for row in table[1:])])


def timed(stretch: float) -> Callable[[Table], str]:
    return lambda table: text([table[0], *([repr(float(row[0]) * stretch), *row[1:]] for row in table[1:])])


# fault -> the text of the log, and what the message names
WRONG: dict[str, tuple[Callable[[Table], str], tuple[str, ...]]] = {
    "NaN": (put(502, "fin", "nan"), ("row 502, column fin", "not a finite number")),
    "a fill value": (put(502, "fin", "1e300"), ("row 502, column fin", "no number that a bench can show")),
    "time backwards": (put(502, "time", "0.1"), ("row 502, column time", "time does not increase")),
    "wrong unit": (headed("fin[deg]", "fin[s]"), ("row 1, column fin", "wrong dimension")),
    "one name twice": (headed("fin[deg]", "rate[deg]"), ("row 1", "two columns of one name", "'rate'")),
    "no column of the design": (without("command", "fin", "rate", "sensed"), ("no measured signal",)),
    "no time": (without("time"), ("no time column",)),
    "empty": (lambda table: "", ("the file is empty",)),
    "header only": (first(0), ("a header but no rows",)),
    "one row": (first(1), ("two rows or more",)),
    "truncated": (lambda table: text(table)[:-15], ("row 2002", "is the log truncated?")),
    "time in days": (timed(86400.0), ("in another time than the design", "the design's frame is 0.002 s")),
    "time in a far smaller unit": (timed(1e-6), ("in another time than the design",)),
}  # fmt: skip
# what compare answers and a search refuses
TOO_LITTLE: dict[str, tuple[Callable[[Table], str], tuple[str, ...]]] = {
    **{
        f"{rows} rows": (first(rows), ("a diagnosis needs 100 rows or more", f"found {rows}"))
        for rows in (2, 3, 10, 99)
    },
    "at rest": (standing("0"), ("short.csv", "no column ever changes")),
    "constant": (standing("1.5"), ("short.csv", "no column ever changes")),
    "nothing drives it": (without("demand"), ("lacks a signal that drives the loop", "'demand'")),
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("fault", WRONG)
def test_a_wrong_log_is_said(inside: Run, home: Path, tmp_path: Path, command: str, fault: str) -> None:
    change, words = WRONG[fault]
    log = tmp_path / "bad.csv"
    log.write_text(change(cells(home)))
    message = said(inside(command, home / "bench.toml", log))
    for word in ("bad.csv",) if fault != "no column of the design" else ():
        assert word in message
    for word in words:
        assert word in message, message


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("case", TOO_LITTLE)
def test_a_log_that_shows_too_little(inside: Run, home: Path, tmp_path: Path, command: str, case: str) -> None:
    change, words = TOO_LITTLE[case]
    log = tmp_path / "short.csv"
    log.write_text(change(cells(home)))
    done = inside(command, home / "bench.toml", log)
    if command == "compare":
        assert done.returncode == 0 and "Warning" not in done.stderr, done.stderr
        return
    message = said(done)
    for word in words:
        assert word in message, message


def uneven(table: Table) -> str:
    moved = np.random.default_rng(0).uniform(0.0, 8e-4, len(table) - 1).tolist()
    return text([table[0], *([repr(float(r[0]) + m), *r[1:]] for r, m in zip(table[1:], moved, strict=True))])


# what is odd but no fault: the log, a warning, whether the dead band must be found
ODD: dict[str, tuple[Callable[[Table], str], str, bool]] = {
    "a few hundred rows": (first(300), "", False),
    "a few rows lost": (lambda table: text(table[:900] + table[912:]), "1 gap in time", True),
    "a long gap": (lambda table: text(table[:800] + table[1200:]), "1 gap in time", True),
    "uneven": (uneven, "unevenly spaced", True),
    "starts late": (
        lambda table: text([table[0], *([repr(float(r[0]) + 1e4), *r[1:]] for r in table[1:])]), "", True,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", ODD)
def test_an_odd_log_is_answered(inside: Run, home: Path, tmp_path: Path, case: str) -> None:
    change, warning, found = ODD[case]
    log, answer = tmp_path / "odd.csv", tmp_path / "answer.json"
    log.write_text(change(cells(home)))
    done = inside("diagnose", home / "bench.toml", log, "--budget", 60, "--json", answer)
    assert done.returncode == 0 and "Warning" not in done.stderr, done.stderr
    written = strict(answer.read_text())
    assert warning in done.stderr + " ".join(written["notes"])
    effects = [one["effect"] for one in written["missing"] if one["certain"]]
    assert effects == ["dead_band"] if found else set(effects) <= {"dead_band"}, written["missing"]
