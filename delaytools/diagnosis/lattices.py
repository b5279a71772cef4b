"""Quantisers that a log shows by itself: all values of a column lie on a lattice."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.places import spots
from delaytools.loop.port import Port, find_port

__all__ = [
    "ahead_of_lattice",
    "lattice_step",
    "on_lattice",
    "quantisers_shown",
    "rounded_exits",
    "step_through_noise",
]

Array = NDArray[np.float64]
SAME = 1e-3  # of a step: nearer than this, two lattices are one
NEAREST_STEPS, TURNS = 8, 3  # steps beside 0 that are told apart first, and times that they are counted again
CLEAR = 0.15  # of a step: noise below it leaves no doubt which step a value belongs to


def lattice_step(values: Array) -> float:
    """The step of the lattice on which all values (n,) lie, or 0 where there is none."""
    found = np.unique(values)
    if len(found) < 3 or len(found) > 0.5 * len(values):
        return 0.0
    steps = np.diff(found)
    steps = steps[steps > 1e-7 * np.abs(found).max()]
    if not len(steps):
        return 0.0
    step = float(steps.min())
    counts = np.round((found - found[0]) / step)
    step = float(np.polyfit(counts, found, 1)[0])
    off = np.abs(found / step - np.round(found / step))
    return step if off.max() < 0.02 and np.ptp(found) / step < 2000 else 0.0


def step_through_noise(values: Array, near: float) -> tuple[float, float] | None:
    """The step of a lattice through 0 on which all values (n,) lie but for their noise, and its standard error.

    near: the step, within a few percent. By least squares on the numbers of the steps, from the innermost on, since
    these are told apart by a step that is a little off. None where the noise hides which step a value belongs to.
    """
    step, reach = near, NEAREST_STEPS
    size = np.abs(values)
    while True:
        inside = values[size < (reach + 0.5) * step]
        for _ in range(TURNS):
            count = np.round(inside / step)
            if not count.any():
                return None
            step = float(count @ inside / (count @ count))
        if reach * step > size.max():
            break
        reach *= 2
    count = np.round(values / step)
    spread = float(np.std(values - step * count))
    return (step, spread / float(np.sqrt(count @ count))) if spread < CLEAR * step else None


def on_lattice(case: Case, port: Port) -> Added | None:
    """The quantiser at a measured output whose column lies on a lattice."""
    exit = case.exit_at(str(port))
    step = lattice_step(np.concatenate([m[:, exit] for m in case.measured])) if exit is not None else 0.0
    if not step:
        return None
    held, errors = frozenset({"step"}), {"step": 1e-4 * step}
    return Added("quantization", str(port), {"step": step}, {}, held, {}, errors)


def ahead_of_lattice(case: Case, fitted: Fitted, one: Added) -> Added:
    """The effect ahead of a quantiser at its port whose lattice the log shows: behind it, values would leave that."""
    ranks = [a.rank for a in fitted.added if a.at == one.at and a.kind == "quantization"]
    if not ranks or on_lattice(case, find_port(case.segment.loop, one.at)) is None:
        return one
    return replace(one, rank=min(ranks) - 1)


def quantisers_shown(case: Case, fitted: Fitted, least: float) -> tuple[Added, ...]:
    """Quantisers at exits that lie on a lattice where the model's do not.

    Noise ahead of a quantiser hides its error: the residual grows no smaller by it, but the log shows it plainly.
    least: rms of a step's error, of the noise, from which on it matters.
    """
    outputs, found = case.outputs(fitted.added, fitted.values), []
    for port in (spot.port for spot in spots(case.segment) if spot.kind == "quantization"):
        exit, one = case.exit_at(str(port)), on_lattice(case, port)
        if exit is None or one is None or one.values["step"] / np.sqrt(12) < least * case.whitening[exit].rms:
            continue
        known = lattice_step(np.concatenate([rows[:, exit] for rows in outputs]))
        if abs(known - one.values["step"]) > SAME * one.values["step"]:
            found.append(one)
    return tuple(found)


def rounded_exits(case: Case, fitted: Fitted) -> dict[int, float]:
    """Place of an exit -> step of the quantiser that writes it, where noise leaves no doubt which step a row is on.

    Such a column is known exactly, whatever the model says of the rows at which it steps.
    """
    found = {}
    for one in fitted.added:
        exit = case.exit_at(one.at) if one.kind == "quantization" else None
        alone = sum(other.at == one.at for other in fitted.added) == 1
        if exit is not None and alone and not case.pieces:
            told = step_through_noise(np.concatenate([m[:, exit] for m in case.measured]), one.values["step"])
            found |= {exit: told[0]} if told is not None else {}
    return found
