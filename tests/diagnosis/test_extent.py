"""A search works on as many rows as its budget bears, and says so."""

import numpy as np
import pytest

from delaytools.diagnosis.extent import FEWEST, LEAST, MOST, searched_rows
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError


def record(rows: int, name: str) -> Record:
    return Record(np.arange(rows) * 1e-3, {"a": np.arange(rows) % 7.0}, source=f"logs/{name}.csv; a note")


def test_a_long_log_is_cut_and_said() -> None:
    (found,), (said,) = searched_rows([record(MOST + 5, "long")])
    assert len(found) == MOST and found.time[0] == 0.0
    assert said.startswith(f"long.csv: the search works on the first {MOST} of {MOST + 5} rows")


def test_logs_share_the_rows_and_short_ones_stay_whole() -> None:
    found, said = searched_rows([record(MOST, "long"), record(FEWEST, "short")])
    assert [len(one) for one in found] == [MOST // 2, FEWEST] and len(said) == 1
    assert searched_rows([record(MOST, "full")])[1] == ()


def test_short_logs_count_together() -> None:
    several = [record(FEWEST // 2, name) for name in ("a", "b")]
    assert [len(one) for one in searched_rows(several)[0]] == [FEWEST // 2] * 2
    for few in (several[:1], [*several, record(LEAST - 1, "c")]):
        with pytest.raises(AnalysisError, match="rows or more"):
            searched_rows(few)
