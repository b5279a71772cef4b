"""What a design says of its logs: beginnings, smooth columns, and configurations that differ in numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from delaytools.design.build import build
from delaytools.design.design import Design
from delaytools.diagnosis.case import Case
from delaytools.loop.loop import Loop
from delaytools.loop.values import value_paths, with_numbers
from delaytools.signals.trouble import AnalysisError

__all__ = ["as_logged", "differing"]


def differing(design: Design, configurations: Sequence[str | None]) -> tuple[Mapping[str, float], ...]:
    """Per log, the values by path in which its configuration differs from the first log's."""
    first = build(design, configurations[0])
    return tuple(_differing(first, build(design, name), name) for name in configurations)


def _differing(first: Loop, other: Loop, name: str | None) -> Mapping[str, float]:
    ours, theirs = value_paths(first), value_paths(other)
    if set(ours) != set(theirs):
        odd = sorted(set(ours) ^ set(theirs))
        raise AnalysisError(
            "logs together need configurations that differ in numbers alone", where=name or "", found=", ".join(odd)
        )
    named = {path: v for path, v in theirs.items() if path.startswith("parameters.") and v != ours[path]}
    moved = value_paths(with_numbers(first, named)) if named else ours
    return {**named, **{path: v for path, v in theirs.items() if v != moved[path]}}


def as_logged(
    case: Case,
    design: Design,
    pieces: tuple[tuple[tuple[int, int], ...], ...],
    numbers: tuple[Mapping[str, float], ...],
) -> Case:
    """The case with what the design says of its logs; `numbers` of other segments are left out."""
    known = value_paths(case.segment.loop)
    own = tuple({path: v for path, v in one.items() if path in known} for one in numbers)
    table = design.tables
    return replace(
        case,
        pieces=pieces,
        numbers=own if any(own) else (),
        substeps=table.simulation.substeps,
        smooth=case.smooth | frozenset(table.log.smooth),
    )
