"""Design files as files: the same bytes back, and files that are no design."""

from pathlib import Path

import pytest

from delaytools.design.build import build, check_paths, flight, warnings
from delaytools.design.design import parse_design
from delaytools.design.file import read_design, write_design
from delaytools.design.stimuli import design_stimuli
from delaytools.signals.trouble import DelaytoolsError
from tests.design.benches import BENCH

HERE = Path(__file__).resolve().parents[2]
DESIGNS = sorted((HERE / "designs").glob("*.toml"))
PRACTICE = sorted((HERE.parent / "shared" / "practice").glob("*/bench.toml"))
TEXTS = {
    "as it is": lambda text: text,
    "CRLF": lambda text: text.replace("\n", "\r\n"),
    "no newline at the end": lambda text: text.rstrip("\n"),
    "blank lines at the end": lambda text: text + "\n\n\n",
    "tabs and marks": lambda text: text.replace(" = ", "\t=  ") + "\n# π ≈ 3 — ü\n",
}


@pytest.mark.parametrize("path", DESIGNS, ids=lambda path: path.stem)
@pytest.mark.parametrize("change", TEXTS.values(), ids=TEXTS)
def test_the_same_bytes_come_back(path: Path, change, tmp_path: Path) -> None:
    before = change(path.read_bytes().decode("utf-8")).encode("utf-8")
    there, back = tmp_path / "there.toml", tmp_path / "back.toml"
    there.write_bytes(before)
    write_design(read_design(there), back)
    assert back.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["back.toml", "there.toml"]


@pytest.mark.parametrize("path", DESIGNS, ids=lambda path: path.stem)
def test_every_configuration_of_the_designs_builds(path: Path) -> None:
    design = read_design(path)
    for name in (None, *design.configurations):
        loop = build(design, name)
        check_paths(design, loop)
        assert warnings(design, loop) == ()
        assert flight(design, name).elements


@pytest.mark.practice
@pytest.mark.skipif(not PRACTICE, reason="no practice benches beside the project")
@pytest.mark.parametrize("path", PRACTICE, ids=lambda path: path.parent.name)
def test_every_practice_bench_loads(path: Path, tmp_path: Path) -> None:
    design = read_design(path)
    loop = build(design)
    check_paths(design, loop)
    design_stimuli(design, loop)
    assert warnings(design, loop) == ()
    write_design(design, tmp_path / "back.toml")
    assert (tmp_path / "back.toml").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    "content, word",
    [
        (b"", "the file is empty"),
        (b"\n  \n", "the file is empty"),
        (bytes(range(256)) * 4, "not a text file"),
        (b"\0\1\2 = 3\n" * 9, "not a TOML file"),
        ("frame = 1".encode("utf-16"), "not a text file"),
        (b"time[s],fin\n0,1\n", "not a TOML file"),
        (b"<html></html>", "not a TOML file"),
    ],
    ids=["empty", "blank", "binary", "zeros", "utf-16", "a log", "html"],
)
def test_files_that_are_no_design(content: bytes, word: str, tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_bytes(content)
    with pytest.raises(DelaytoolsError) as caught:
        read_design(path)
    assert str(caught.value).startswith(f"{path}: {word}"), caught.value


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "roll_bench.toml").write_text(BENCH)
    with pytest.raises(
        DelaytoolsError, match=r"no such file; found roll_bnch.toml.*nearest: roll_bench.toml"
    ):
        read_design(tmp_path / "roll_bnch.toml")
    with pytest.raises(DelaytoolsError, match="Is a directory"):
        read_design(tmp_path)


def test_writing_where_nothing_can_be_written(tmp_path: Path) -> None:
    design = parse_design(BENCH)
    with pytest.raises(DelaytoolsError, match="cannot be written"):
        write_design(design, tmp_path / "nowhere" / "bench.toml")
    (tmp_path / "taken").mkdir()
    with pytest.raises(DelaytoolsError, match="cannot be written"):
        write_design(design, tmp_path / "taken")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]
