"""One run for each configuration, driven by the design's [inputs]."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.design.design import Design
from delaytools.design.stimuli import design_stimuli
from delaytools.design.values import number
from delaytools.loop.loop import Loop
from delaytools.report.cases import Asked, Case
from delaytools.signals.record import Record
from delaytools.simulation.simulate import SignalFigures, simulate

__all__ = ["Run", "Runs", "run_case", "shown_signals"]

SHOWN = 4.0  # s of each run that are drawn
DEMANDS = ("step", "pulse", "doublet", "sine", "chirp", "formula", "multisine")


@final
@dataclass(frozen=True)
class Run:
    """record: what is drawn, the first seconds only; figures: of the whole run, last half for oscillations.

    grows: the last quarter is ten times the second one; diverged: time (s) from which values are not finite.
    """

    name: str
    record: Record
    figures: Mapping[str, SignalFigures]
    seconds: float
    grows: bool
    diverged: float | None


@final
@dataclass(frozen=True)
class Runs:
    """signals: the columns to be drawn; demand: (external input, signal that answers it) or ("", "")."""

    runs: tuple[Run, ...]
    signals: tuple[str, ...]
    demand: tuple[str, str]
    units: Mapping[str, str]
    seed: int


def run_case(design: Design, case: Case, signals: tuple[str, ...]) -> Run:
    """The case run for the design's duration with its seed."""
    table = design.tables.simulation
    stimuli = design_stimuli(design, case.loop, seed=table.seed)
    answer = simulate(
        case.loop,
        stimuli,
        duration=number(table.duration, "s"),
        seed=table.seed,
        substeps=table.substeps,
    )
    kept = [name for name in dict.fromkeys(signals) if name in answer.record]
    record = answer.record.between(0.0, SHOWN).only(kept)
    grows = answer.diverged is not None or any(
        _grows(answer.record[name]) for name in signals if name in answer.record
    )
    return Run(case.name, record, answer.figures, answer.seconds_simulated, grows, answer.diverged)


def _grows(values: NDArray[np.float64]) -> bool:
    quarter = max(1, len(values) // 4)
    early, late = (np.abs(values[k * quarter : (k + 1) * quarter]).max(initial=0.0) for k in (1, 3))
    return bool(late > 10 * early > 0)


def shown_signals(design: Design, loop: Loop, asked: Asked) -> tuple[tuple[str, ...], tuple[str, str]]:
    """(signals to draw, the demand and its answer): the answer to the demand, the opened signal, the first rate."""
    driven = design.tables.inputs
    demand = next((n for n, table in driven.items() if table.get("type") in DEMANDS), "")
    answer = _answer(loop, demand) if demand else ""
    rates = [n for n in loop.signals if loop.units.get(n, "").endswith("/s") and n in loop.writers]
    first = next((n for n in rates if loop.writers[n][0] not in _sampled(loop)), "")
    chosen = [n for n in (answer, asked.at, first) if n]
    spare = [n for n in loop.signals if n in loop.writers and n not in chosen]
    chosen = list(dict.fromkeys(chosen))
    return tuple(chosen + spare[: max(0, 2 - len(chosen))]), (demand, answer) if answer else ("", "")


def _sampled(loop: Loop) -> set[str]:
    return {element.name for element in loop.sampled}


def _answer(loop: Loop, demand: str) -> str:
    """The signal of the demand's unit that stands beside it in the same input."""
    for element in loop.elements:
        for expression in element.inputs.values():
            if demand in expression.names:
                same = [
                    n for n in expression.names if n in loop.writers and _unit(loop, n) == _unit(loop, demand)
                ]
                if same:
                    return same[0]
    return ""


def _unit(loop: Loop, name: str) -> str:
    return loop.units.get(name, "")
