"""A page as data: sections with sentences, tables and figures, the same for HTML and PDF."""

from dataclasses import dataclass
from typing import final

__all__ = ["Drawn", "Page", "Section", "Table"]


@final
@dataclass(frozen=True)
class Drawn:
    """A figure: name (file and anchor), caption, one <svg> element, width in points of the sheet it wants."""

    name: str
    caption: str
    svg: str
    width: float


@final
@dataclass(frozen=True)
class Table:
    """heads and rows of words; marks: for each row "", "bad", "warn" or "good". words: columns set to the left."""

    caption: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marks: tuple[str, ...] = ()
    words: tuple[int, ...] = (0,)


@final
@dataclass(frozen=True)
class Section:
    """lead: the one sentence of what is to be seen. missing: what could not be shown, and why."""

    key: str
    title: str
    lead: str
    paragraphs: tuple[str, ...] = ()
    figures: tuple[Drawn, ...] = ()
    tables: tuple[Table, ...] = ()
    missing: tuple[str, ...] = ()


@final
@dataclass(frozen=True)
class Page:
    """The whole report. facts: (name, value) under the title. tone of the verdict: "bad", "warn", "good"."""

    title: str
    facts: tuple[tuple[str, str], ...]
    tone: str
    sections: tuple[Section, ...]
