"""The wiring of a block's table: names of signals at its ports, and the formulas at its inputs."""

import re
from collections.abc import Mapping
from typing import Any

from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError, shown

__all__ = ["check_block_name", "input_formula", "port_names", "ported"]

_NAME = re.compile(r"[^\s.@\[\]'\"#:]+")
RESERVED = ("parameters", "effects")


def check_block_name(name: str) -> None:
    """Raises DesignError for a block's name that no port or path could hold."""
    if name in RESERVED:
        raise DesignError(
            f"{name!r} cannot be the name of a block",
            where="blocks",
            advice=f"paths that begin with {name} mean the table of that name: choose another name",
        )
    if not _NAME.fullmatch(name):
        raise DesignError(
            f"{name!r} cannot be the name of a block",
            where="blocks",
            advice="ports and paths are written BLOCK.NAME: leave out spaces, dots, quotes, colons, brackets, @ and #",
        )


def port_names(table: Mapping[str, Any], key: str, place: str) -> Any:
    """The wiring under `input`/`inputs` (or output): a dictionary by port, or a list in port order."""
    plural = f"{key}s"
    if key in table and plural in table:
        raise DesignError(f"both {key} and {plural}", where=place, advice="give one of them")
    found = table.get(key, table.get(plural))
    if found is None:
        raise DesignError("missing required value", where=f"{place}.{key}", advice=f'write {key} = "SIGNAL"')
    wired = [found] if isinstance(found, str) else found
    if not isinstance(wired, list | dict) or not wired:
        raise DesignError(
            "the name of a signal, or a list of them, is wanted", where=f"{place}.{key}", found=shown(found)
        )
    return wired


def ported(wired: Any, ports: tuple[str, ...]) -> dict[str, str]:
    """Port -> text; raises DesignError for a port that is unknown, missing or without text."""
    if isinstance(wired, list):
        if len(wired) != len(ports):
            raise DesignError(
                "wrong number of signals",
                found=f"{len(wired)}",
                advice=f"give {len(ports)}, for " + ", ".join(ports),
            )
        wired = dict(zip(ports, wired, strict=True))
    for port, text in wired.items():
        if port not in ports:
            raise DesignError("unknown port", found=repr(port), known=ports)
        if not isinstance(text, str):
            raise DesignError("the name of a signal is wanted", where=port, found=shown(text))
    for port in ports:
        if port not in wired:
            raise DesignError("a port without a signal", found=port, advice=f"wire {port}")
    return dict(wired)


def input_formula(text: Any) -> Expression:
    """A signal or a combination of signals, as text."""
    if not isinstance(text, str):
        raise DesignError(
            "a signal, or a formula of signals, is wanted", found=shown(text), advice="write it in quotes"
        )
    return Expression(text)
