"""The door of the report: answers are gathered, drawn, and written to files."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import final

from matplotlib.figure import Figure

from delaytools.design.design import Design
from delaytools.report.compensation import Compensation
from delaytools.report.contents import gather
from delaytools.report.evidence import Evidence
from delaytools.report.html import html_page
from delaytools.report.pages import page_of
from delaytools.report.pdf import pdf_bytes
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["ReportFiles", "write_figure", "write_report"]

FORMATS, DPI = ("png", "svg", "pdf"), 150


@final
@dataclass(frozen=True)
class ReportFiles:
    """The paths written: pages (HTML, PDF) and figures (SVG)."""

    pages: tuple[str, ...]
    figures: tuple[str, ...]


def _silent(_: str) -> None:
    """No progress is told."""


def write_report(
    design: Design,
    out_dir: str | Path,
    *,
    progress: Callable[[str], None] = _silent,
    compensations: tuple[Compensation, ...] = (),
    evidence: Evidence | None = None,
) -> ReportFiles:
    """Write report.html, report.pdf and figures/*.svg of a design into `out_dir`.

    progress is called with a few words before each step. compensations: what tuning found, besides the design's own.
    evidence: what logs say of the design (a comparison, and a diagnosis where one was made).
    Raises DesignError where the design cannot be built, DelaytoolsError where a file cannot be written.
    """
    page = page_of(gather(design, progress, compensations, evidence))
    progress("pages")
    home = Path(out_dir)
    files = {home / "report.html": html_page(page).encode(), home / "report.pdf": pdf_bytes(page)}
    drawings = {
        home / "figures" / f"{figure.name}.svg": figure.svg.encode()
        for section in page.sections
        for figure in section.figures
    }
    for path, content in (files | drawings).items():
        _write(path, content)
    return ReportFiles(tuple(map(str, files)), tuple(map(str, drawings)))


def write_figure(figure: Figure, path: str | Path) -> None:
    """One figure as PNG, SVG or PDF, by the end of the file's name.

    Raises DelaytoolsError for another one, and where the file cannot be written.
    """
    target, content = Path(path), io.BytesIO()
    kind = target.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise DelaytoolsError("no format of a figure", where=str(path), found=repr(target.suffix), known=FORMATS)
    figure.savefig(content, format=kind, dpi=DPI)
    _write(target, content.getvalue())


def _write(path: Path, content: bytes) -> None:
    """The whole file, or nothing of it."""
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(content)
        part.replace(path)
    except OSError as error:
        raise DelaytoolsError(f"cannot be written: {error.strerror}", where=str(path)) from error
