"""How deep the values of a block are nested: a number, a list of numbers, or a matrix."""

from dataclasses import fields
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from delaytools.signals.trouble import DesignError, shown

__all__ = ["check_shape_of"]

_WORDS = {0: "a number", 1: "a list of numbers", 2: "a matrix: a list of rows"}


def check_shape_of(kind: type, name: str, raw: Any) -> None:
    """Raises DesignError where the value `name` of a block is nested otherwise than its class says."""
    annotation = next(f.type for f in fields(kind) if f.name == name)
    wanted, found = _depths(annotation), _depth(raw)
    if found not in wanted:
        words = " or ".join(_WORDS.get(depth, f"{depth} levels") for depth in sorted(wanted))
        raise DesignError(f"{words} is wanted here", found=shown(raw), advice=_example(wanted))
    if found and not raw:
        raise DesignError("a list without numbers", found="[]", advice=_example(wanted))
    if found == 2 and len({len(row) for row in raw}) > 1:
        lengths = ", ".join(str(len(row)) for row in raw)
        raise DesignError("the rows of a matrix have one length", found=f"rows of {lengths}")
    if found == 2 and not raw[0]:
        raise DesignError("a matrix without columns", found=shown(raw))


def _example(wanted: set[int]) -> str:
    return "write [[1.0, 0.0], [0.0, 1.0]]" if 2 in wanted else "write [1.0, 2.0]" if 1 in wanted else ""


def _depths(annotation: Any) -> set[int]:
    arguments, origin = get_args(annotation), get_origin(annotation)
    if origin is tuple:
        return {1 + depth for depth in _depths(arguments[0])}
    if origin in (Union, UnionType):
        return set().union(*(_depths(one) for one in arguments if one is not NoneType))
    return {0}


def _depth(raw: Any) -> int:
    if not isinstance(raw, list):
        return 0
    return 1 + max((_depth(item) for item in raw), default=0)
