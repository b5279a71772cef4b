"""What the design says of its own numbers: comments that say *assumed* or cite a source, with their place."""

import re
from dataclasses import dataclass
from typing import final

from delaytools.design.design import Design

__all__ = ["Remark", "remarks"]

_ASSUMED = re.compile(r"\bassumed\b", re.IGNORECASE)
_SOURCE = re.compile(
    r"\b[A-Z][a-z]+(?: (?:and|&) [A-Z][a-z]+| et al\.)?,? \(?(?:19|20)\d\d\b|\beq\. |\bfig\. |\bdoi\b"
)
_TABLE = re.compile(r"^\s*\[\[?\s*([^\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"^\s*([A-Za-z0-9_\"'.-]+)\s*=")


@final
@dataclass(frozen=True)
class Remark:
    """place: path in the design; value: what the file says there ("" for a comment of its own); assumed or cited."""

    place: str
    value: str
    text: str
    assumed: bool


def remarks(design: Design) -> tuple[Remark, ...]:
    """Every comment that says *assumed* or cites a source, in the file's order."""
    found, table, own = [], "", []
    for line in design.text.splitlines():
        code, comment = _split(line)
        if comment is not None and not code.strip():
            own.append(comment.strip())
            continue
        if match := _TABLE.match(code):
            table = match.group(1).replace('"', "")
        if code.strip():
            found += _own(own, table)
            own = []
        if comment is not None and _telling(comment):
            key = _KEY.match(code)
            name = key.group(1).strip("\"'") if key else ""
            value = code.partition("=")[2].strip() if key else ""
            place = ".".join(part for part in (table, name) if part)
            found.append(Remark(place, value, _clean(comment), bool(_ASSUMED.search(comment))))
    return tuple(found + _own(own, table))


def _own(lines: list[str], table: str) -> list[Remark]:
    text = " ".join(lines)
    if not _telling(text):
        return []
    return [Remark(table or "head of the file", "", _clean(text), bool(_ASSUMED.search(text)))]


def _telling(text: str) -> bool:
    return bool(_ASSUMED.search(text) or _SOURCE.search(text))


def _clean(text: str) -> str:
    text = re.sub(r"-{3,}", "", text).replace("*", "")
    return re.sub(r"\s+", " ", text).strip()


def _split(line: str) -> tuple[str, str | None]:
    """(what stands before the comment, the comment or None), quotes respected."""
    quote = ""
    for place, sign in enumerate(line):
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        elif sign == "#":
            return line[:place], line[place + 1 :]
    return line, None
