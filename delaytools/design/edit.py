"""Design → Design: a value, an effect more or an effect less, and not one other mark of the text changed."""

import copy
import re
from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.items import AoT, InlineTable

from delaytools.design.configurations import override
from delaytools.design.design import Design, parse_design
from delaytools.signals.trouble import DesignError, shown

__all__ = ["with_effect", "with_value", "without_effect"]

_MARK = "\N{REPLACEMENT CHARACTER}here\N{REPLACEMENT CHARACTER}"
_HEADER = re.compile(r"^\s*\[\[\s*[\"']?effects[\"']?\s*\]\]")
Keys = tuple[str | int, ...]


def with_value(design: Design, path: str, value: Any, *, comment: str = "") -> Design:
    """The design with `value` at `BLOCK.VALUE`, `parameters.NAME` or `effects.N.VALUE`, as a file would write it.

    A value that the file leaves at its default gets a line of its own. A comment stands above the line.
    Raises DesignError for a path that is not there.
    """
    wanted = copy.deepcopy(design.data)
    try:
        override(wanted, path, value)
    except DesignError as error:
        raise error.at(design.name) from error
    keys = _keys(design, path)
    text = design.text
    if _holds(design.data, keys):
        start, end = _span(text, keys)
        text = text[:start] + _written(value) + text[end:]
        return _checked(design, _commented(text, start, comment), wanted)
    start, end = _last(text, keys[:-1])
    line = f"{keys[-1]} = {_written(value)}"
    if _is_inline(text, keys[:-1]):
        text = f"{text[:end]}, {line}{text[end:]}"
        return _checked(design, _commented(text, start, comment), wanted)
    at = _line_end(text, end)
    indent = re.match(r"[ \t]*", text[_line_start(text, start) :])
    line = _newline(text) + (indent.group(0) if indent else "") + line
    text = text[:at] + line + text[at:]
    return _checked(design, _commented(text, at + len(line), comment), wanted)


def with_effect(design: Design, table: Mapping[str, Any], *, comment: str = "") -> Design:
    """The design with one [[effects]] table more, after the last one there is; its comment stands above it."""
    wanted = copy.deepcopy(design.data)
    wanted.setdefault("effects", []).append(dict(table))
    text, new = design.text, _newline(design.text)
    notes = [f"# {line}" for line in comment.splitlines()]
    lines = [*notes, "[[effects]]", *(f"{_key(name)} = {_written(raw)}" for name, raw in table.items())]
    count = len(design.data.get("effects", []))
    if count:
        _need_tables(design)
        at = _line_end(text, _last(text, ("effects", count - 1))[1])
    else:
        at = len(text.rstrip())
    gap = new * 2 if at else ""
    return _checked(design, text[:at] + gap + new.join(lines) + text[at:], wanted)


def without_effect(design: Design, index: int) -> Design:
    """The design without its effect number `index`, the comment right above it, and one blank line before that.

    Raises DesignError for a number that is not there, and where a configuration overrides an effect by its number.
    """
    count = len(design.data.get("effects", []))
    if not 0 <= index < count:
        known = [str(number) for number in range(count)]
        advice = "effects are counted from 0" if known else "the design has no [[effects]]"
        raise DesignError("no such effect", where=design.name, found=str(index), known=known, advice=advice)
    _need_tables(design)
    _no_override(design, index)
    wanted = copy.deepcopy(design.data)
    del wanted["effects"][index]
    if not wanted["effects"]:
        del wanted["effects"]
    text = design.text
    start, end = _effect_lines(text, index)
    if end >= len(text) and not text.endswith("\n"):
        start = len(text[:start].removesuffix("\n").removesuffix("\r"))
    return _checked(design, text[:start] + text[end:], wanted)


def _effect_lines(text: str, index: int) -> tuple[int, int]:
    first, last = _first(text, ("effects", index)), _last(text, ("effects", index))[1]
    start = _line_start(text, first)
    while not _HEADER.match(text[start:]):
        start = _line_start(text, start - 1)
    while start and text[_line_start(text, start - 1) : start].lstrip().startswith("#"):
        start = _line_start(text, start - 1)
    if start and not text[_line_start(text, start - 1) : start].strip():
        start = _line_start(text, start - 1)
    end = text.find("\n", last)
    return start, len(text) if end < 0 else end + 1


def _no_override(design: Design, index: int) -> None:
    for name, table in design.tables.configurations.items():
        for path in table.set:
            match = re.match(r"effects\.(\d+)\.", path)
            if match and int(match.group(1)) >= index:
                raise DesignError(
                    "a configuration names effects by their number",
                    where=f"{design.name}: configurations.{name}.set",
                    found=repr(path),
                    advice=f"change that path first: removing effects.{index} moves the later ones up",
                )


def _need_tables(design: Design) -> None:
    if not isinstance(tomlkit.parse(design.text)["effects"], AoT):
        raise DesignError(
            "effects in one list cannot be edited",
            where=f"{design.name}: effects",
            advice="write each under [[effects]]",
        )


def _keys(design: Design, path: str) -> Keys:
    """The keys under which a path stands in the file."""
    first, _, rest = path.partition(".")
    key = rest.partition(".")[2] if first == "effects" else rest
    name, *places = [part for part in re.split(r"[\[\]]+", key) if part]
    inner: Keys = (name, *(int(place) for place in places))
    if first == "parameters":
        return ("parameters", *inner)
    if first == "effects":
        number = int(rest.partition(".")[0])
        own = design.data["effects"][number].get("parameters", {})
        if design.data["effects"][number].get("type") == "formula" and name in own:
            return ("effects", number, "parameters", *inner)
        return ("effects", number, *inner)
    table = design.data["blocks"][first]
    if table.get("type") == "equations":
        home = next((key for key in ("parameters", "states") if name in table.get(key, {})), None)
        if home:
            return ("blocks", first, home, *inner)
    return ("blocks", first, *inner)


def _holds(data: Any, keys: Keys) -> bool:
    for key in keys:
        if isinstance(key, str) and key not in data:
            return False
        data = data[key]
    return True


def _span(text: str, keys: Keys) -> tuple[int, int]:
    """Where the value under these keys stands in the text."""
    whole = tomlkit.parse(text)
    home: Any = whole
    for key in keys[:-1]:
        home = home[key]
    old = home[keys[-1]].as_string()
    home[keys[-1]] = _MARK
    start = tomlkit.dumps(whole).find(f'"{_MARK}"')
    if start < 0 or not text.startswith(old, start):
        raise DesignError("this value cannot be found in the text", found=".".join(map(str, keys)))
    return start, start + len(old)


def _spans(text: str, keys: Keys) -> list[tuple[int, int]]:
    home: Any = tomlkit.parse(text)
    for key in keys:
        home = home[key]
    plain = [key for key in home if not isinstance(home[key], Mapping) or isinstance(home[key], InlineTable)]
    return sorted(_span(text, (*keys, str(key))) for key in plain)


def _first(text: str, keys: Keys) -> int:
    return _spans(text, keys)[0][0]


def _last(text: str, keys: Keys) -> tuple[int, int]:
    return _spans(text, keys)[-1]


def _is_inline(text: str, keys: Keys) -> bool:
    home: Any = tomlkit.parse(text)
    for key in keys:
        home = home[key]
    return isinstance(home, InlineTable)


def _written(value: Any) -> str:
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(name)} = {_written(raw)}" for name, raw in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    return tomlkit.item(value).as_string()


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _written(name)


def _newline(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _line_start(text: str, at: int) -> int:
    return text.rfind("\n", 0, max(at, 0)) + 1


def _line_end(text: str, at: int) -> int:
    """The end of the line, its line break left out."""
    end = text.find("\n", at)
    end = len(text) if end < 0 else end
    return end - 1 if text[end - 1 : end] == "\r" and end < len(text) else end


def _commented(text: str, at: int, comment: str) -> str:
    """The text with a comment above the line that holds the place `at`."""
    if not comment:
        return text
    start = _line_start(text, at)
    indent = re.match(r"[ \t]*", text[start:])
    before = indent.group(0) if indent else ""
    lines = "".join(f"{before}# {line}{_newline(text)}" for line in comment.splitlines())
    return text[:start] + lines + text[start:]


def _checked(design: Design, text: str, wanted: Mapping[str, Any]) -> Design:
    """The design of the new text, which must hold exactly what is wanted."""
    new = parse_design(text, design.name)
    if new.data != wanted:
        odd = [key for key in {*new.data, *wanted} if new.data.get(key) != wanted.get(key)]
        raise DesignError(
            "the text could not be edited safely",
            where=design.name,
            found=shown(odd),
            advice="edit it by hand",
        )
    return new
