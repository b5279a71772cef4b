"""Every format gives the same record; every fault is said by file, row and column; nothing is lost in silence."""

import gzip
import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from delaytools.measurement.formats import registry
from delaytools.measurement.log_file import Columns, read_log, write_log
from delaytools.measurement.log_notes import log_notes
from delaytools.signals.record import Record
from delaytools.signals.trouble import LogError

T = np.arange(400) * 1e-3
DATA = {"time": T, "fin": np.sin(9 * T), "rate": np.cos(9 * T), "count": np.arange(400), "on": T > 0.2}
UNITS = {"time": "s", "fin": "deg", "rate": "deg/s", "count": "", "on": ""}
Written = Callable[[Path, dict[str, np.ndarray], dict[str, str]], None]


def csv(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    columns = {name: np.asarray(values, dtype=float) for name, values in data.items() if name != "time"}
    write_log(Record(data["time"], columns, units), path)


def packed(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    csv(path.with_suffix(".csv"), data, units)
    path.write_bytes(gzip.compress(path.with_suffix(".csv").read_bytes()))
    path.with_suffix(".csv").unlink()


def npz(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    np.savez(path, **{f"{name}[{units.get(name, '')}]": values for name, values in data.items()})


def mat(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    savemat(path, data | {"units": units or {"none": ""}})


def struct(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    savemat(path, {"log": data | {"units": units}})


def hdf5(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, values in data.items():
            file[f"run/{name}"] = values
            file[f"run/{name}"].attrs["units"] = units.get(name, "")


def mat73(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in data.items():
            file[name] = np.atleast_2d(values)
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        for name, unit in units.items():
            file[f"units/{name}"] = np.array([[ord(letter)] for letter in unit or "\0"], dtype="u2")
            file[f"units/{name}"].attrs["MATLAB_class"] = np.bytes_("char")
            if not unit:
                del file[f"units/{name}"]
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))


def parquet(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    arrays = {name: pa.array(values) for name, values in data.items()}
    fields = [pa.field(name, a.type, metadata={"unit": units.get(name, "")}) for name, a in arrays.items()]
    pq.write_table(pa.table(list(arrays.values()), schema=pa.schema(fields)), path)


def mf4(path: Path, data: dict[str, np.ndarray], units: dict[str, str]) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append(
            [
                asammdf.Signal(
                    values.astype("u1") if values.dtype == bool else values,
                    data["time"],
                    name=name,
                    unit=units.get(name, ""),
                )
                for name, values in data.items()
                if name != "time"
            ]
        )
        file.save(path, overwrite=True)


FORMATS: dict[str, tuple[str, Written]] = {
    "CSV": ("run.csv", csv),
    "text": ("run.txt", csv),
    "gzipped CSV": ("run.csv.gz", packed),
    "NPZ": ("run.npz", npz),
    "MAT": ("run.mat", mat),
    "MAT struct": ("run.mat", struct),
    "MAT 7.3": ("run.mat", mat73),
    "HDF5": ("run.h5", hdf5),
    "Parquet": ("run.parquet", parquet),
    "MDF4": ("run.mf4", mf4),
}
each_format = pytest.mark.parametrize("name, write", FORMATS.values(), ids=FORMATS)
BINARY = {key: FORMATS[key] for key in FORMATS if key not in ("CSV", "text")}


@each_format
def test_every_format_gives_the_same_record(name: str, write: Written, tmp_path: Path) -> None:
    write(tmp_path / name, DATA, UNITS)
    found = read_log(tmp_path / name)
    assert found.time == pytest.approx(T, abs=1e-12)
    assert set(found.names) == {"fin", "rate", "count", "on"}
    for signal in found.names:
        assert found[signal].dtype == float
        assert found[signal] == pytest.approx(np.asarray(DATA[signal], dtype=float), abs=1e-11)
        assert found.units[signal] == UNITS[signal]
    assert found.source == str(tmp_path / name)


@each_format
def test_units_are_converted_and_columns_mapped(name: str, write: Written, tmp_path: Path) -> None:
    write(tmp_path / name, DATA, UNITS)
    found = read_log(tmp_path / name, Columns(columns={"fin": "elevator"}, units={"elevator": "rad"}))
    assert found["elevator"] == pytest.approx(np.radians(DATA["fin"]), abs=1e-11)
    assert found.units["elevator"] == "rad"


def changed(column: str, values: object) -> dict[str, np.ndarray]:
    new = DATA[column].astype(float)
    new[7:9] = values
    return DATA | {column: new}


BAD = {
    "NaN": (changed("fin", np.nan), UNITS, ("column fin", "not a finite number", "in 2 rows")),
    "infinity": (changed("rate", np.inf), UNITS, ("column rate", "not a finite number")),
    "time stands": (changed("time", T[6]), UNITS, ("time does not increase",)),
    "time backwards": (changed("time", 0.0), UNITS, ("time does not increase",)),
    "wrong dimension": (DATA, UNITS | {"fin": "s"}, ("column fin", "wrong dimension", "in deg")),
    "unknown unit": (DATA, UNITS | {"fin": "degs"}, ("column fin", "unknown unit", "nearest: deg")),
    "one row": ({k: v[:1] for k, v in DATA.items()}, UNITS, ("two rows or more", "truncated?")),
    "missing column": (
        {k: v for k, v in DATA.items() if k != "rate"},
        UNITS,
        ("missing column", "no column rate, nor speed", "fin"),
    ),
}


@pytest.mark.parametrize("data, units, words", BAD.values(), ids=BAD)
@each_format
def test_a_fault_is_said_alike_in_every_format(
    name: str,
    write: Written,
    data: dict[str, np.ndarray],
    units: dict[str, str],
    words: tuple[str, ...],
    tmp_path: Path,
) -> None:
    write(tmp_path / name, data, units)
    mapping = Columns(columns={"rate": "speed"}, units={"fin": "deg"})
    with pytest.raises(LogError) as caught:
        read_log(tmp_path / name, mapping)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / name)), message
    for word in words:
        assert word in message, message
    if "row 1," not in message and len(data["time"]) > 1 and len(data) == len(DATA) and data is not DATA:
        assert ("row 9" if "csv" in name or "txt" in name else "row 8") in message, message


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.98])
@pytest.mark.parametrize("name, write", BINARY.values(), ids=BINARY)
def test_a_truncated_file_is_said(
    name: str, write: Written, share: float, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    write(path, DATA, UNITS)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(LogError) as caught:
        read_log(path)
    assert str(caught.value).startswith(str(path))
    assert "truncated?" in str(caught.value) or "damaged or truncated" in str(caught.value)
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize("name", ["run.npz", "run.mat", "run.h5", "run.parquet", "run.mf4"])
def test_an_empty_file(name: str, tmp_path: Path) -> None:
    (tmp_path / name).touch()
    with pytest.raises(LogError, match=r"the file is empty; is the log truncated\?"):
        read_log(tmp_path / name)


@each_format
def test_a_constant_signal_and_uneven_rows_are_read(name: str, write: Written, tmp_path: Path) -> None:
    uneven = T + 3e-4 * np.sin(np.arange(400))
    write(tmp_path / name, {"time": uneven, "fin": np.full(400, 2.5)}, {"time": "s", "fin": "deg"})
    found = read_log(tmp_path / name)
    assert found.time == pytest.approx(uneven, abs=1e-11) and set(found["fin"]) == {2.5}
    assert any("unevenly spaced" in note for note in log_notes(found))


@pytest.mark.parametrize("name, write", BINARY.values(), ids=BINARY)
def test_the_first_bytes_are_believed_where_the_suffix_lies(
    name: str, write: Written, tmp_path: Path
) -> None:
    write(tmp_path / name, DATA, UNITS)
    for wrong in ("other.csv", "other.parquet", "other.mat", "other.log"):
        (tmp_path / wrong).write_bytes((tmp_path / name).read_bytes())
        assert set(read_log(tmp_path / wrong).names) == {"fin", "rate", "count", "on"}


def test_text_in_a_file_named_otherwise_is_csv(tmp_path: Path) -> None:
    (tmp_path / "run.mat").write_text("time[s],a\n0,1\n1,2\n")
    assert read_log(tmp_path / "run.mat").names == ("a",)


def test_binary_rubbish_is_no_log(tmp_path: Path) -> None:
    for name in ("run.npz", "run.mat", "run.h5", "run.parquet", "run.mf4", "run.csv"):
        (tmp_path / name).write_bytes(bytes(range(256)) * 20)
        with pytest.raises(LogError, match="run"):
            read_log(tmp_path / name)


def test_what_is_no_column_of_numbers_is_left_out_and_said(tmp_path: Path) -> None:
    odd = {"state": np.array(["ok"] * 400), "z": T + 1j, "mass": np.array(3.5), "cube": np.zeros((2, 2, 2))}
    np.savez(tmp_path / "run.npz", **(DATA | odd))
    found = read_log(tmp_path / "run.npz")
    assert set(found.names) == {"fin", "rate", "count", "on"}
    (note,) = log_notes(found)
    for part in ("state (text)", "z (complex", "mass (one value", "cube (an array of 2×2×2"):
        assert part in note
    for name, reason in {"state": "text", "z": "complex", "mass": "one value"}.items():
        with pytest.raises(LogError, match=f"column {name}: not a column of numbers; found {reason}"):
            read_log(tmp_path / "run.npz", Columns(units={name: "deg"}))


def test_a_text_column_in_csv_is_left_out_unless_needed(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time[s],state,a\n0,idle,1\n1,busy,2\n")
    found = read_log(path)
    assert found.names == ("a",) and log_notes(found) == (f"{path}: left out: state (text)",)
    with pytest.raises(LogError, match="column state: not a column of numbers; found text"):
        read_log(path, Columns(columns={"state": "mode"}))
    path.write_text("time[s],state,a\n0,idle,1\n1,busy,\n")
    with pytest.raises(LogError, match=r"row 3, column 3 \(a\): an empty cell"):
        read_log(path)


def test_a_table_is_split_into_columns(tmp_path: Path) -> None:
    table = np.arange(1200.0).reshape(400, 3)
    savemat(tmp_path / "run.mat", {"time": T[:, None], "fins": table, "turned": table.T})
    found = read_log(tmp_path / "run.mat")
    assert found.names == tuple(f"{name}[{k}]" for name in ("fins", "turned") for k in range(3))
    assert found["fins[1]"].tolist() == found["turned[1]"].tolist() == table[:, 1].tolist()
    write_log(found, tmp_path / "run.csv")
    assert read_log(tmp_path / "run.csv").names == found.names


def test_times_of_day_are_counted_from_the_first(tmp_path: Path) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    stamps = np.datetime64("2026-01-05T10:00:00") + np.arange(5) * np.timedelta64(10, "ms")
    pq.write_table(pa.table({"time": stamps, "a": np.arange(5.0)}), tmp_path / "run.parquet")
    found = read_log(tmp_path / "run.parquet")
    assert found.time == pytest.approx(np.arange(5) * 0.01)
    assert "time is counted from 2026-01-05T10:00" in log_notes(found)[0]


def test_nulls_of_parquet_are_no_numbers(tmp_path: Path) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    pq.write_table(pa.table({"time": [0.0, 1.0, 2.0], "n": [1, None, 3]}), tmp_path / "run.parquet")
    with pytest.raises(LogError, match="row 2, column n: not a finite number"):
        read_log(tmp_path / "run.parquet")


def two_rasters(path: Path, late: float = 0.0) -> None:
    asammdf = pytest.importorskip("asammdf")
    slow = np.arange(41) * 1e-2 + late
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(np.sin(9 * T), T, name="fin", unit="deg")])
        ramp, mode = 2 * slow, (100 * (slow - late)).round().astype("i4") // 10
        signals = [("ramp", ramp), ("mode", mode), ("command", ramp)]
        file.append([asammdf.Signal(values, slow, name=name) for name, values in signals])
        file.save(path, overwrite=True)


def test_rasters_are_brought_together_and_said(tmp_path: Path) -> None:
    two_rasters(tmp_path / "run.mf4")
    found = read_log(tmp_path / "run.mf4", Columns(units={"fin": "deg"}, held=frozenset({"command"})))
    assert found.time == pytest.approx(T) and found["ramp"] == pytest.approx(2 * T)
    assert found["mode"] == pytest.approx(np.floor(T * 10 + 1e-9))
    assert found["command"] == pytest.approx(0.02 * np.floor(T * 100 + 1e-9))
    assert found.held == {"command", "mode"}
    (note,) = log_notes(found)
    assert note.endswith(
        "ramp interpolated linearly, mode, command held from rows every 0.01 s to rows every 0.001 s"
    )


def test_only_where_all_wanted_rasters_are_logged(tmp_path: Path) -> None:
    two_rasters(tmp_path / "run.mf4", late=0.1)
    found = read_log(tmp_path / "run.mf4")
    assert found.time[0] == pytest.approx(0.1) and len(found) == 300
    assert any("left out: 100 rows" in note for note in log_notes(found))
    only = read_log(tmp_path / "run.mf4", Columns(units={"fin": "deg"}))
    assert len(only) == 400 and only.names == ("fin",)
    assert any("left out: ramp, mode, command" in note for note in log_notes(only))
    two_rasters(tmp_path / "run.mf4", late=100.0)
    with pytest.raises(
        LogError, match=r"share no time; found fin from 0 to 0.399 s; ramp, mode, command from 100"
    ):
        read_log(tmp_path / "run.mf4")


def test_groups_with_clocks_of_their_own(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for place, step in {"fast": 1e-3, "slow": 1e-2}.items():
            file[f"{place}/time"] = np.arange(400) * step
            file[f"{place}/{place}_ramp"] = np.arange(400) * step
            file[f"{place}/both"] = np.zeros(400)
    found = read_log(tmp_path / "run.h5")
    assert found.names == ("both",) or set(found.names) == {
        "fast/both",
        "fast_ramp",
        "slow/both",
        "slow_ramp",
    }
    assert found["slow_ramp"] == pytest.approx(found.time) and found["fast_ramp"] == pytest.approx(found.time)
    assert found.time[-1] == pytest.approx(0.399)


def test_a_reader_of_another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "benchlog.py").write_text(
        "import numpy as np\n"
        "from delaytools.measurement.formats.table import Table\n"
        "def read(path):\n"
        "    rows = np.array([[float(x) for x in line.split()] for line in path.open()])\n"
        "    return Table(('time', 'fin'), ('ms', 'deg'), (rows[:, 0], rows[:, 1]))\n"
    )
    about = tmp_path / "benchlog-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: benchlog\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[delaytools.log_formats]\nbench = benchlog:read\n")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    (tmp_path / "run.bench").write_text("0 1\n10 2\n20 4\n")
    found = read_log(tmp_path / "run.bench")
    assert found.time == pytest.approx([0.0, 0.01, 0.02]) and found["fin"].tolist() == [1.0, 2.0, 4.0]
    assert ".bench" in registry.known_suffixes()
    with pytest.raises(LogError, match=r"no such file; found rum.bench; known: run.bench"):
        read_log(tmp_path / "rum.bench")


MISSING = {"run.h5": "h5py", "run.parquet": "pyarrow", "run.mf4": "asammdf"}


@pytest.mark.parametrize("name, package", MISSING.items())
def test_a_package_that_is_not_installed(
    name: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in [m for m in sys.modules if m.startswith("delaytools.measurement.formats.")]:
        if module.endswith(("hdf5", "parquet", "mdf")):
            monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)
    (tmp_path / name).write_bytes(b"\0\1\2\3")
    with pytest.raises(LogError) as caught:
        read_log(tmp_path / name)
    assert f"needs the package {package}, which is not installed" in str(caught.value)
    assert str(caught.value).endswith("pip install delaytools[formats]")


def test_a_log_is_written_as_csv_only(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"logs are written as CSV; found .mat; name it .csv"):
        write_log(Record(T, {"a": T}), tmp_path / "run.mat")
    assert list(tmp_path.iterdir()) == []
