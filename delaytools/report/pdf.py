"""A page as PDF: a typst template, the figures as SVG bytes, the words as JSON."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import matplotlib
import typst
from jinja2 import PackageLoader

from delaytools.report.html import ENVIRONMENT
from delaytools.report.page import Page

__all__ = ["pdf_bytes"]

_LOADER = PackageLoader("delaytools.report", "templates")


def pdf_bytes(page: Page) -> bytes:
    """The PDF, the same bytes for the same page: no date, no system fonts."""
    template = _LOADER.get_source(ENVIRONMENT, "report.typ")[0]
    files: Any = {"main": template.encode(), "page.json": json.dumps(_plain(page)).encode()}
    for section in page.sections:
        files |= {f"{figure.name}.svg": figure.svg.encode() for figure in section.figures}
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    return bytes(typst.compile(files, format="pdf", font_paths=[str(fonts)], ignore_system_fonts=True))


def _plain(page: Page) -> dict[str, Any]:
    """The page's words; of the figures name, caption and width only."""
    found = dataclasses.asdict(page)
    for section in found["sections"]:
        for figure in section["figures"]:
            del figure["svg"]
    return found
