"""Logs: what is read, in which units, and what is wrong with a log, by file, row and column."""

import time
from pathlib import Path

import numpy as np
import pytest

from delaytools.measurement.log_file import Columns, read_log, write_log
from delaytools.measurement.log_notes import log_notes
from delaytools.signals.record import Record
from delaytools.signals.trouble import LogError

HEAD = "time[s],fin[deg],rate[deg/s]\n"
ROWS = "0,1,2\n0.1,1,2\n0.2,1,2\n"
WANTED = Columns(units={"fin": "deg", "rate": "deg/s"})


def log(tmp_path: Path, content: str | bytes) -> Path:
    path = tmp_path / "run.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path


WRONG = {
    "empty": ("", ("the file is empty", "header row")),
    "blank": ("\n\n", ("the header row is empty",)),
    "header only": (HEAD, ("a header but no rows", "truncated?")),
    "one row": (HEAD + "0,1,2\n", ("two rows or more", "truncated?")),
    "NaN": (HEAD + ROWS + "0.3,nan,2\n", ("row 5, column fin", "not a finite number", "mend or cut")),
    "infinities": (HEAD + ROWS + "0.3,1,inf\n0.4,1,-inf\n", ("row 5, column rate", "in 2 rows")),
    "time backwards": (HEAD + ROWS + "0.15,1,2\n", ("row 5, column time", "time does not increase")),
    "time stands": (HEAD + ROWS + "0.2,1,2\n", ("row 5, column time", "time does not increase")),
    "time is NaN": (HEAD + ROWS + "nan,1,2\n", ("row 5, column time", "not a finite number")),
    "truncated row": (HEAD + ROWS + "0.3,1", ("row 5", "2 values instead of 3", "truncated?")),
    "truncated cell": (
        HEAD + ROWS + "0.3,1,",
        ("row 5, column 3 (rate[deg/s])", "an empty cell", "truncated?"),
    ),
    "half a number": (
        HEAD + ROWS + "0.3,1,2.3e",
        ("row 5, column 3 (rate[deg/s])", "not a number", "'2.3e'"),
    ),
    "word": (HEAD + ROWS + "0.3,abc,2\n", ("row 5, column 2 (fin[deg])", "not a number", "'abc'")),
    "word after a blank line": (HEAD + ROWS + "\n0.3,abc,2\n", ("row 6, column 2 (fin[deg])",)),
    "empty cell": (HEAD + ROWS + "0.3,,2\n", ("row 5, column 2 (fin[deg])", "an empty cell")),
    "long row": (HEAD + "0,1,2\n0.1,1,2,3\n", ("row 3", "4 values instead of 3")),
    "rows longer than the header": ("time,a\n0,1,2\n1,1,2\n", ("row 2", "3 values, 2 names")),
    "one name twice": (
        "time,fin,fin\n" + ROWS,
        ("row 1", "two columns of one name", "'fin' in columns 2, 3"),
    ),
    "one name in two units": ("time,fin[deg],fin[rad]\n" + ROWS, ("two columns of one name", "'fin'")),
    "wrong dimension": (
        HEAD.replace("[deg]", "[s]") + ROWS,
        ("row 1, column fin", "wrong dimension", "'s'", "in deg"),
    ),
    "unknown unit": (
        HEAD.replace("[deg]", "[degs]") + ROWS,
        ("row 1, column fin", "unknown unit", "nearest: deg"),
    ),
    "time in degrees": (HEAD.replace("[s]", "[deg]") + ROWS, ("row 1, column time", "wrong dimension")),
    "no time": (
        HEAD.replace("time", "T") + ROWS,
        ("row 1", "no time column", "known: T, fin, rate", "[log]"),
    ),
    "no header": (ROWS, ("row 1", "numbers where the header row should be")),
    "semicolons": ((HEAD + ROWS).replace(",", ";"), ("row 1", "semicolons", "commas")),
    "tabs": ((HEAD + ROWS).replace(",", "\t"), ("row 1", "tabs", "commas")),
    "binary": (bytes(range(256)) * 8, ("not a text file",)),
    "zeros": (b"\0\1\2\3" * 100, ("not a text file",)),
    "UTF-16": ((HEAD + ROWS).encode("utf-16"), ("not a text file",)),
}


@pytest.mark.parametrize("content, words", WRONG.values(), ids=WRONG)
def test_a_wrong_log_is_said(content: str | bytes, words: tuple[str, ...], tmp_path: Path) -> None:
    path = log(tmp_path, content)
    with pytest.raises(LogError) as caught:
        read_log(path, WANTED)
    message = str(caught.value)
    assert message.startswith(str(path)), message
    for word in words:
        assert word in message, message


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    log(tmp_path, HEAD + ROWS)
    with pytest.raises(LogError, match=r"no such file; found rnu.csv; known: run.csv; nearest: run.csv"):
        read_log(tmp_path / "rnu.csv")
    with pytest.raises(LogError, match="Is a directory"):
        read_log(tmp_path)


@pytest.mark.parametrize(
    "content",
    [
        HEAD + ROWS,
        (HEAD + ROWS).replace("\n", "\r\n"),
        "\ufeff" + HEAD + ROWS,
        HEAD + ROWS.rstrip("\n"),
        HEAD + ROWS.replace("\n", "\n\n"),
        HEAD.replace(",", " , ") + ROWS.replace(",", ", "),
        '"time[s]","fin[deg]","rate[deg/s]"\n' + ROWS,
    ],
    ids=["plain", "CRLF", "byte order mark", "no newline at the end", "blank lines", "spaces", "quotes"],
)
def test_a_log_is_read(content: str, tmp_path: Path) -> None:
    found = read_log(log(tmp_path, content), WANTED)
    assert found.time.tolist() == [0.0, 0.1, 0.2]
    assert found.names == ("fin", "rate") and dict(found.units) == {"fin": "deg", "rate": "deg/s"}


def test_units_are_converted_and_extra_columns_kept(tmp_path: Path) -> None:
    content = "T[ms],fin[rad],bus[degs]\n0,1,5\n100,2,6\n"
    found = read_log(log(tmp_path, content), Columns(time="T", units={"fin": "deg"}))
    assert found.time == pytest.approx([0.0, 0.1])
    assert found["fin"] == pytest.approx(np.degrees([1.0, 2.0]))
    assert found["bus"].tolist() == [5.0, 6.0]


def test_columns_are_mapped_to_signals(tmp_path: Path) -> None:
    found = read_log(log(tmp_path, "T,PS\n0,1\n1,2\n"), Columns("T", {"PS": "rate"}, {"rate": "deg/s"}))
    assert found.names == ("rate",) and found.units["rate"] == "deg/s"


def test_a_log_may_use_the_signals_own_names(tmp_path: Path) -> None:
    found = read_log(log(tmp_path, HEAD + ROWS), Columns("T", {"PS": "rate"}))
    assert found.names == ("fin", "rate")


def test_a_mapped_column_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(
        LogError, match=r"missing column; found no column PS, nor speed; known: time, fin, rate"
    ):
        read_log(log(tmp_path, HEAD + ROWS), Columns(columns={"PS": "speed"}))


def test_two_columns_for_one_signal(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="two columns for one signal; found fin and rate, both rate"):
        read_log(log(tmp_path, HEAD + ROWS), Columns(columns={"fin": "rate"}))


def test_written_and_read_again(tmp_path: Path) -> None:
    t = np.arange(0.0, 1.0, 1e-3)
    before = Record(t, {"fin": np.sin(9 * t) / 3, "on": t > 0.5}, {"fin": "deg"})
    write_log(before, tmp_path / "run.csv")
    after = read_log(tmp_path / "run.csv")
    assert after.time == pytest.approx(t, rel=1e-11)
    assert after["fin"] == pytest.approx(before["fin"], rel=1e-11)
    assert dict(after.units) == {"fin": "deg", "on": ""}
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]


def test_nothing_half_written_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*args: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savetxt", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_log(Record(np.arange(3.0), {"a": np.arange(3.0)}), tmp_path / "run.csv")
    assert list(tmp_path.iterdir()) == []


def test_where_nothing_can_be_written(tmp_path: Path) -> None:
    record = Record(np.arange(3.0), {"a": np.arange(3.0)})
    (tmp_path / "taken").mkdir()
    for path in (tmp_path / "nowhere" / "run.csv", tmp_path / "taken"):
        with pytest.raises(LogError, match="cannot be written"):
            write_log(record, path)
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_a_million_rows_in_seconds(tmp_path: Path) -> None:
    rows = "".join(f"{k / 1000:.3f},0.5,-1.25,3\n" for k in range(1_000_000))
    path = log(tmp_path, "time[s],a[deg],b,c\n" + rows)
    begin = time.perf_counter()
    assert len(read_log(path)) == 1_000_000
    assert time.perf_counter() - begin < 15.0


def test_gaps_and_uneven_rows_are_said() -> None:
    def record(t: list[float]) -> Record:
        return Record(np.array(t), {"a": np.zeros(len(t))}, source="run.csv")

    assert log_notes(record([0.0, 0.1, 0.2, 0.3])) == ()
    (gap,) = log_notes(record([0.0, 0.1, 0.2, 1.7, 1.8, 1.9]))
    assert gap.startswith("run.csv: 1 gap in time, the longest 1.5 s after row 4 (t = 0.2 s)")
    (uneven,) = log_notes(record([0.0, 0.1, 0.21, 0.3, 0.4]))
    assert "unevenly spaced" in uneven
