"""What a design says under [log] holds for a comparison: rows that count, beginnings that are not at rest, gaps."""

import numpy as np
import pytest

from delaytools.measurement.compare import compare
from delaytools.signals.record import Record
from delaytools.signals.trouble import AnalysisError
from tests.measurement.bench_logs import BENCH, bench_design, bench_log


def rows_of(record: Record, keep: np.ndarray) -> Record:
    columns = {name: record[name][keep] for name in record.names}
    return Record(record.time[keep], columns, record.units, record.held, record.source)


def verdicts(record: Record, log: str = "") -> dict[str, str]:
    return {one.signal: one.verdict for one in compare(bench_design(f"{BENCH}\n[log]\n{log}\n"), [record]).signals}


def test_rows_that_do_not_count_fail_nothing() -> None:
    """The gyro is unplugged for two seconds, and an auxiliary column says when."""
    record = bench_log()
    loose = (record.time > 4.0) & (record.time < 6.0)
    columns = {**{n: record[n] for n in record.names}, "sensed": np.where(loose, 0.0, record["sensed"])}
    spoilt = Record(record.time, columns | {"plugged": (~loose).astype(float)}, record.units, record.held, "run.csv")
    assert verdicts(spoilt)["sensed"] == "fails"
    assert verdicts(spoilt, 'where = "plugged > 0.5"')["sensed"] == "adequate"
    one = compare(bench_design(f'{BENCH}\n[log]\nwhere = "plugged > 0.5"\n'), [spoilt])["sensed"]
    time, _, model = one.traces[0]
    assert np.isnan(model[loose]).all() and np.isfinite(model[~loose]).all() and len(time) == len(record)
    assert one.strips.time_shares[17:23].sum() == 0.0
    assert one.strips.time_shares.sum() == pytest.approx(1.0)


def test_where_must_leave_something() -> None:
    with pytest.raises(AnalysisError, match="no row of the log counts"):
        verdicts(bench_log(duration=1.0), 'where = "demand > 1e6"')


def test_a_log_that_begins_in_the_middle_of_a_run() -> None:
    record = bench_log()
    late = rows_of(record, record.time > 3.3)
    assert "fails" in verdicts(late).values()
    assert set(verdicts(late, 'start = "free"').values()) == {"adequate"}


def test_states_begin_anew_behind_a_long_gap() -> None:
    record = bench_log()
    assert set(verdicts(rows_of(record, (record.time < 4.0) | (record.time > 5.03))).values()) == {"adequate"}


SATURATED = """
title = "A rate taken from a position"
frame = "1 ms"

[signals]
position = "m"
rate = "m/s"

[blocks.differentiator]
type = "equations"
inputs = { x = "position" }
states = { filtered = 0.0 }
rates = { filtered = "1000*(x - filtered)" }
outputs = { limited = "1000*(x - filtered)" }

[blocks.limit]
type = "saturation"
input = "limited"
output = "rate"
limit = "1 m/s"

[analysis]
at = "rate"
"""


def test_a_state_that_no_log_shows_goes_on_where_a_piece_begins() -> None:
    """From 0 again it would saturate what is measured, which then tells nothing of a better beginning."""
    time = np.arange(2000) * 1e-3
    position = 5.0 + 0.1 * np.sin(3.0 * time)
    rate = 0.3 * np.cos(3.0 * time - 3e-3)  # the filter lags by 1 ms
    record = Record(time, {"position": position, "rate": rate}, {}, frozenset(), "run.csv")
    found = compare(bench_design(f'{SATURATED}\n[log]\nwindow = "0.5 s"\n'), [record])["rate"]
    _, measured, model = found.traces[0]
    assert np.abs(measured - model)[500:].max() < 2e-4
