"""Answers as JSON: SI or the signal's unit, never rounded; NaN and infinity as null, with a key that says why."""

import dataclasses
import json
import math
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from delaytools.signals.trouble import DelaytoolsError

__all__ = ["check_targets", "plain", "write_json"]


def plain(item: Any) -> Any:
    """Dictionaries, lists, numbers and words made of an answer; a key without a number gets a sibling `KEY_why`."""
    if dataclasses.is_dataclass(item) and not isinstance(item, type):
        return plain({field.name: getattr(item, field.name) for field in dataclasses.fields(item)})
    if isinstance(item, Mapping):
        found: dict[str, Any] = {}
        for key, value in item.items():
            found[str(key)] = plain(value)
            if isinstance(value, float) and not math.isfinite(value):
                found[f"{key}_why"] = "not a number" if math.isnan(value) else "infinite"
        return found
    if isinstance(item, complex):
        return [item.real, item.imag]
    if isinstance(item, float):
        return item if math.isfinite(item) else None
    if isinstance(item, str | int | bool) or item is None:
        return item
    if hasattr(item, "tolist"):
        return plain(item.tolist())
    if isinstance(item, list | tuple | set | frozenset):
        return [plain(element) for element in item]
    return str(item)


def write_json(answer: Mapping[str, Any], target: str) -> None:
    """Write an answer to a file, whole or not at all; `-` is standard output."""
    text = json.dumps(plain(answer), indent=1, allow_nan=False)
    if target == "-":
        sys.stdout.write(text + "\n")
        return
    path = Path(target)
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text + "\n", encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise DelaytoolsError(f"cannot be written: {error.strerror}", where=target) from error
    finally:
        if part.is_file():
            part.unlink()


def check_targets(*files: str | None, log: str | None = None, directory: str | None = None) -> None:
    """Raises DelaytoolsError, before anything is computed, where a file could not be written.

    files: paths, None or "-". log: a CSV log that shall be written. directory: one that is made where it is not there.
    """
    for target in (*files, log):
        if target is None or target == "-":
            continue
        path = Path(target)
        if path.is_dir():
            raise DelaytoolsError("cannot be written: Is a directory", where=target)
        if directory is not None and path.parent == Path(directory):
            continue
        if not path.parent.is_dir():
            raise DelaytoolsError("cannot be written: there is no such directory", where=target)
        if not os.access(path.parent, os.W_OK):
            raise DelaytoolsError("cannot be written: Permission denied", where=target)
    if log is not None:
        _check_log(Path(log))
    if directory is not None:
        _check_directory(Path(directory))


def _check_log(path: Path) -> None:
    from delaytools.measurement.formats.registry import BINARY

    if path.suffix.lower() in (*BINARY, ".gz"):
        raise DelaytoolsError("logs are written as CSV", where=str(path), found=path.suffix, advice="name it .csv")


def _check_directory(path: Path) -> None:
    there = next(home for home in (path, *path.resolve().parents) if home.exists())
    if not there.is_dir():
        raise DelaytoolsError("cannot be written: not a directory", where=str(there))
    if not os.access(there, os.W_OK):
        raise DelaytoolsError("cannot be written: Permission denied", where=str(there))
