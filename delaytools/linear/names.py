"""Names of inputs and outputs: default ones, joined ones, and the choice among them."""

from collections.abc import Sequence
from operator import index
from typing import Any

from delaytools.signals.trouble import AnalysisError

__all__ = ["chosen", "default_names", "joined_names"]


def default_names(names: Sequence[str], prefix: str, *, count: int) -> tuple[str, ...]:
    """The names given, or prefix0, prefix1, ... where none are; AnalysisError for a wrong or doubled name."""
    names = tuple(names)
    if not names:
        return tuple(f"{prefix}{i}" for i in range(count))
    if len(names) != count:
        raise AnalysisError(f"{count} names are needed", found=f"{len(names)}: {', '.join(names)}")
    if len(set(names)) != count:
        raise AnalysisError("each name may stand once", found=", ".join(names))
    return names


def joined_names(first: tuple[str, ...], second: tuple[str, ...], prefix: str) -> tuple[str, ...]:
    """Both lists; default names are counted anew, a name that stands in both gets _2 (_3, ...) in the second."""
    plain = tuple(f"{prefix}{i}" for i in range(max(len(first), len(second))))
    if first == plain[: len(first)] and second == plain[: len(second)]:
        return tuple(f"{prefix}{i}" for i in range(len(first) + len(second)))
    names = list(first)
    for name in second:
        fresh, number = name, 2
        while fresh in names or (fresh != name and fresh in second):
            fresh, number = f"{name}_{number}", number + 1
        names.append(fresh)
    return tuple(names)


def chosen(key: Any, names: tuple[str, ...]) -> list[int]:
    """Indices for an index, a name, a slice or a list of indices and names; AnalysisError if unknown."""
    if isinstance(key, slice):
        return list(range(len(names)))[key]
    if isinstance(key, (list, tuple)):
        return [one for item in key for one in chosen(item, names)]
    if isinstance(key, str):
        if key not in names:
            raise AnalysisError("no such signal", found=repr(key), known=names)
        return [names.index(key)]
    number = index(key)
    if not -len(names) <= number < len(names):
        raise AnalysisError("no such signal", found=f"number {number}", known=names)
    return [number % len(names)]
