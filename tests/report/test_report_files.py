"""The files of a report: there, self-contained, complete, and honest about what a design leaves out."""

import re
from pathlib import Path

from delaytools.design.design import parse_design
from delaytools.design.file import read_design
from delaytools.report.write import ReportFiles, write_report
from tests.report.conftest import SERVO

ROLL = Path(__file__).parents[2] / "designs" / "roll_autopilot.toml"
EVERY = {"margins", "diagram", "budget", "waterfall", "sweep", "nyquist", "locus", "runs", "compensation"}
NAMESPACES = ("http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink")


def outside(html: str) -> list[str]:
    """Addresses in the page that are no names of namespaces."""
    return [url for url in re.findall(r"https?://[^\s\"'<>]+", html) if url not in NAMESPACES]


def check(files: ReportFiles, wanted: set[str]) -> str:
    """The HTML of a report whose files were found to be in order."""
    html, pdf = (Path(path) for path in files.pages)
    text, content = html.read_text(encoding="utf-8"), pdf.read_bytes()
    assert {Path(path).stem for path in files.figures} == wanted
    assert all(Path(path).read_text(encoding="utf-8").startswith("<svg") for path in files.figures)
    assert outside(text) == []
    assert "<script" not in text and "<link" not in text and "@import" not in text
    assert text.count("<svg") == len(wanted)
    assert len(text) < 3_000_000
    assert content.startswith(b"%PDF")
    return text


def test_the_report_of_a_small_design(written: tuple[ReportFiles, list[str]]) -> None:
    files, said = written
    text = check(files, EVERY)
    assert said[0] == "block diagram" and said[-1] == "pages"
    assert "Servo &amp; &lt;table&gt;" in text and "<table>: design" not in text
    for name in ("slow", "compensated", "lost"):
        assert name in text
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))


def test_every_anchor_of_the_contents_is_there(written: tuple[ReportFiles, list[str]]) -> None:
    text = Path(written[0].pages[0]).read_text(encoding="utf-8")
    anchors = re.findall(r'<li><a href="#([^"]+)"', text)
    assert len(anchors) == 11
    assert all(f'<section id="{anchor}">' in text for anchor in anchors)


def test_the_pdf_has_several_pages_and_is_reproducible(
    written: tuple[ReportFiles, list[str]], tmp_path: Path
) -> None:
    pdf = Path(written[0].pages[1]).read_bytes()
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) > 1 or int(re.findall(rb"/Count (\d+)", pdf)[0]) > 1
    assert b"CreationDate" not in pdf


def test_a_bare_design_says_what_is_missing(tmp_path: Path) -> None:
    files = write_report(parse_design(SERVO, "bare.toml"), tmp_path)
    text = check(files, EVERY - {"budget", "runs", "compensation"})
    for table in ("[analysis] at", "[analysis] delay_at", "[inputs]", "[flight] remove", "[configurations]"):
        assert table in text


def test_a_design_without_feedback_still_gives_a_report(tmp_path: Path) -> None:
    chain = '[blocks.lag]\ntype = "first_order"\ninput = "u"\noutput = "y"\ntime_constant = "0.1 s"\n'
    text = check(write_report(parse_design(chain, "chain.toml"), tmp_path), {"diagram"})
    assert "no block lies on a feedback path" in text


def test_the_report_of_the_roll_autopilot(tmp_path: Path) -> None:
    text = check(write_report(read_design(ROLL), tmp_path), EVERY | {"cycles"})
    assert "OPTIMISTIC" in text and "dynamic_compensated" in text
    assert "dead_band@actuator.input" in text and "Rao 2023" in text
