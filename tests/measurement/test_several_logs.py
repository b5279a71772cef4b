"""Several logs of one bench carry the same signals in the same units, or the difference is said."""

from pathlib import Path

import pytest

from delaytools.measurement.log_file import Columns, read_logs
from delaytools.signals.trouble import LogError

ROWS = "0,1,2\n1,3,4\n"


def logs(tmp_path: Path, *heads: str) -> list[Path]:
    paths = [tmp_path / f"run{k}.csv" for k in range(len(heads))]
    for path, head in zip(paths, heads, strict=True):
        path.write_text(f"{head}\n{ROWS}")
    return paths


def test_several_logs_are_read_in_order(tmp_path: Path) -> None:
    paths = logs(tmp_path, "time[s],a[deg],b", "time[ms],b,a[deg]")
    one, two = read_logs(paths)
    assert one["a"].tolist() == [1.0, 3.0] and two["a"].tolist() == [2.0, 4.0]
    assert (one.source, two.source) == tuple(map(str, paths))


def test_units_may_differ_where_the_mapping_names_one(tmp_path: Path) -> None:
    paths = logs(tmp_path, "time,a[deg],b", "time,a[rad],extra")
    one, two = read_logs(paths, Columns(units={"a": "deg"}))
    assert one.units["a"] == two.units["a"] == "deg" and "extra" in two


WRONG = {
    "missing": (
        ("time,a,b", "time,a,c"),
        None,
        ("run1.csv, column b", "it stands in", "run0.csv", "known: a, c"),
    ),
    "missing in the first": (
        ("time,a,x", "time,a,b"),
        Columns(units={"a": "", "b": ""}),
        ("run0.csv, column b", "run1.csv"),
    ),
    "units": (("time,a[deg],b", "time,a[rad],b"), None, ("run1.csv, column a", "rad, against deg in")),
    "no unit": (("time,a[deg],b", "time,a,b"), None, ("run1.csv, column a", "no unit, against deg in")),
    "a bad one": (("time,a,b", "T,a,b"), None, ("run1.csv, row 1", "no time column")),
}


@pytest.mark.parametrize("heads, mapping, words", WRONG.values(), ids=WRONG)
def test_a_difference_is_said(
    heads: tuple[str, ...], mapping: Columns | None, words: tuple[str, ...], tmp_path: Path
) -> None:
    with pytest.raises(LogError) as caught:
        read_logs(logs(tmp_path, *heads), mapping)
    for word in words:
        assert word in str(caught.value), str(caught.value)


def test_no_log_at_all() -> None:
    with pytest.raises(LogError, match="no log given"):
        read_logs([])
