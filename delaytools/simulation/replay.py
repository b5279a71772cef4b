"""A piece of a loop driven by what was measured at its entries: the one simulation, run on a log."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import Sampled, Transport
from delaytools.blocks.delay import Delay
from delaytools.blocks.quantizer import Quantizer
from delaytools.blocks.rate_limiter import RateLimiter
from delaytools.loop.loop import Element, Loop
from delaytools.loop.network import Key, network
from delaytools.loop.values import resolve, with_numbers
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column, Stimulus
from delaytools.signals.trouble import AnalysisError
from delaytools.simulation.anew import Anew
from delaytools.simulation.compiling import Pace, compile_loop, moved
from delaytools.simulation.delayed_columns import delayed_columns, driven_late, without
from delaytools.simulation.run import Compiled, run
from delaytools.simulation.sensitivity import run_with_derivatives
from delaytools.simulation.timing import MOST

__all__ = ["Begin", "Replay", "driven_by"]

Array = NDArray[np.float64]
Begin = tuple[int, Mapping[Key, float]]  # row, and the states' values there
JUMPING = 8  # steps per frame where a quantiser of a moving signal may jump anywhere between two rows
SLEWING = 4  # steps per frame where a slew limit may end its ramp within one
EVEN = 1e-3  # of the usual step: rows that lie nearer to an even grid are taken to lie on it
CELLS = 20  # of a row: delays between which a run may be interpolated
KEPT = 12  # compiled steps kept at a time
_STEP = 1e-3  # of a frame or of the value itself, whichever is larger: step of a difference
BRIEF = 3000  # rows of a run that is over before long calls have paid for their making
STIFF = 1.0  # |λ| h of a step: erred by 4e-6 to 6e-5 of a signal's rms, far below measured noise
HOLDING = 1.5  # times that where friction holds, which settles up to 2.8: as many steps less, and χ² hardly knows it
LAST = "last"
SETTLED = 2.0  # stiffness of friction may grow by this before a run gets more steps


def driven_by(
    record: Record, names: Collection[str], *, at_rest: Collection[str] = (), smooth: Collection[str] = ()
) -> dict[str, Stimulus]:
    """The named columns of a record as stimuli, their time counted from the first row.

    at_rest: held signals that were 0 before the first row (written by a sampled block that starts there). smooth:
    columns without noise, joined by a spline instead of straight lines.
    """
    time = record.time - record.time[0]
    return {
        name: Column(
            time=time,
            values=record[name],
            held=name in record.held,
            before=0.0 if name in at_rest else None,
            smooth=name in smooth and name not in record.held,
        )
        for name in names
        if name in record
    }


@final
@dataclass(frozen=True, eq=False)
class Replay:
    """A loop, the stimuli that drive it, and the times (n,) in s at which its signals are wanted.

    free: paths whose values the runs take. All share one compiled step but those that shape the grid of a run: periods
    cost a new one whenever they change, delays where they then look back to other steps. begins: rows at which states
    (element, state) are set to values (NaN: to what the run has there), in order; all others go on. substeps: of a
    frame; None: as many as the loop needs. finer: how many times finer than usual its steps are to be. steps: of each
    frame as last found, by this replay or another of the log. bound: further paths and their values, which stay as they
    are but share compiled steps with replays that have others (times of jumps).
    """

    loop: Loop
    stimuli: Mapping[str, Stimulus]
    time: Array
    signals: tuple[str, ...]
    free: tuple[str, ...] = ()
    begins: tuple[Begin, ...] = ()
    substeps: int | None = None
    finer: int = 1
    steps: dict[str, NDArray[np.int64]] = field(default_factory=dict, repr=False)
    bound: tuple[tuple[str, float], ...] = ()
    _compiled: dict[Any, Compiled] = field(default_factory=dict, repr=False)
    _parts: dict[Any, "Replay"] = field(default_factory=dict, repr=False)

    @cached_property
    def frame(self) -> float:
        """The step of a run in s: the loop's frame, or the nearest shorter one that meets every row."""
        step = self._row_step
        frame = step / math.ceil(step / self.loop.frame - 1e-6) if step else self.loop.frame
        if any(isinstance(e.block, Quantizer) and not self._is_held(e) for e in self.loop.elements):
            return frame / JUMPING
        slewing = any(isinstance(element.block, RateLimiter) for element in self.loop.elements)
        return frame / SLEWING if slewing else frame

    def _is_held(self, element: Element) -> bool:
        """Whether what enters a block is constant between ticks or rows."""
        held = network(resolve(self.loop)).held_signals
        held |= {name for name, one in self._driven({}).items() if isinstance(one, Column) and one.held}
        names = {name for x in element.inputs.values() for name in x.names}
        return names - set(self.loop.parameters) <= held

    @cached_property
    def _row_step(self) -> float:
        """Time between rows in s, or 0 where they are uneven."""
        if len(self.time) < 2:
            raise AnalysisError("a run lasts at least two rows", found=f"{len(self.time)}")
        step = float(self.time[-1] - self.time[0]) / (len(self.time) - 1)
        even = np.abs(self.time - self.time[0] - step * np.arange(len(self.time))).max() < EVEN * step
        return float(round(step, 12)) if even else 0.0

    def run(self, values: tuple[float, ...] = ()) -> Array:
        """(n, signals): the signals at the rows, for these values of the free paths."""
        compiled, chosen, _ = self._ready(values)
        return self._rows(compiled, run(compiled, chosen, self._anew)[1])

    def run_driven(self, values: tuple[float, ...], stimuli: Mapping[str, Stimulus]) -> Array:
        """The run with other stimuli in the place of some, of the same kind: nothing is compiled anew."""
        compiled, chosen, _ = self._ready(values)
        driven = {**compiled.stimuli, **self._driven(self._numbers(values), stimuli)}
        return self._rows(compiled, run(replace(compiled, stimuli=driven), chosen, self._anew)[1])

    def starts(self, values: tuple[float, ...]) -> tuple[Key, ...]:
        """The continuous states (element, state) whose values at the beginning may be free."""
        return self._ready(values)[0].model.layout.states

    def run_with_starts(self, values: tuple[float, ...]) -> tuple[Array, Array]:
        """(n, signals) and (n, signals, states): the signals and their derivatives by each of `starts`.

        By the state's value at the last row where the run begins anew with it, or at the first row.
        """
        compiled, chosen, _ = self._ready(values)
        states = compiled.model.layout.states
        _, rows, slopes = run_with_derivatives(compiled, chosen, anew=self._anew, starts=states, by=())
        return self._rows(compiled, rows), self._rows(compiled, slopes)

    @cached_property
    def _anew(self) -> tuple[Anew, ...]:
        """`begins` by frames: at the row's own, or the last one before it."""
        return tuple(
            Anew(int(self.time[row] / self.frame + EVEN), tuple(states), np.array(list(states.values())))
            for row, states in self.begins
        )

    def run_with_derivatives(self, values: tuple[float, ...]) -> tuple[Array, Array]:
        """(n, signals) and (n, signals, free): the signals at the rows and their derivatives by the free values.

        CasADi's own derivatives of the compiled step; forward differences for values that shape the grid.
        """
        return self._with_slopes(values)

    def _with_slopes(self, values: tuple[float, ...], left_out: int = -1) -> tuple[Array, Array]:
        """`run_with_derivatives`, those by the value at the place `left_out` left 0."""
        smooth = [index for index in range(len(self.free)) if index not in self._shaping]
        slopes = np.zeros((len(self.time), len(self.signals), len(self.free)))
        compiled, chosen, by = self._ready(values)
        _, table, found = run_with_derivatives(compiled, chosen, anew=self._anew, by=by)
        rows, slopes[:, :, smooth] = self._rows(compiled, table), self._rows(compiled, found)
        for index in (k for k in self._shaping if k != left_out):
            slopes[:, :, index] = self._difference(values, index, rows)
        return rows, slopes

    def run_between(self, values: tuple[float, ...]) -> tuple[Array, Array]:
        """As `run_with_derivatives`, with a free constant delay between its neighbours on a grid.

        For fits that only rank: the derivative by the delay is that of a chord, the others are those of the nearer
        neighbour. Straight lines between delays a twentieth of a row apart err by (ωh/20)²/8 of a sine of ω rad/s.
        """
        index = next((k for k, path in enumerate(self.free) if path in self._delay_paths), None)
        if index is None:
            return self.run_with_derivatives(values)
        cell = (self._row_step or self.frame) / CELLS
        left = math.floor(values[index] / cell)
        part = values[index] / cell - left
        ends = [(*values[:index], place * cell, *values[index + 1 :]) for place in (left, left + 1)]
        nearer = round(part)
        near, slopes = self._with_slopes(ends[nearer], index)
        before, after = (near if place == nearer else self.run(end) for place, end in enumerate(ends))
        with np.errstate(over="ignore", invalid="ignore"):  # a run that diverges has no slope
            slopes[:, :, index] = (after - before) / cell
        return (1 - part) * before + part * after, slopes

    def on_grid(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """The values with a free constant delay at its nearest neighbour among those of `run_between`."""
        cell = (self._row_step or self.frame) / CELLS
        return tuple(
            round(v / cell) * cell if p in self._delay_paths else v for p, v in zip(self.free, values, strict=True)
        )

    @cached_property
    def _delay_paths(self) -> frozenset[str]:
        """Free paths of constant delays."""
        constant = [e for e in self.loop.elements if isinstance(e.block, Delay)]
        return frozenset(path for path in self.free for e in constant if path.startswith(f"{e.path}."))

    def _without_grid(self, values: tuple[float, ...], shaping: list[int], smooth: list[int]) -> "Replay":
        """This replay with the values that shape the grid as numbers."""
        if not shaping:
            return self
        key = tuple(values[k] for k in shaping)
        if key not in self._parts:
            paths = self._paths
            loop = with_numbers(self.loop, {paths[k]: values[k] for k in shaping})
            free = tuple(paths[k] for k in smooth)
            if len(self._parts) > KEPT:
                self._parts.clear()
            self._parts[key] = replace(self, loop=loop, free=free, bound=(), _compiled={}, _parts={})
        return self._parts[key]

    def _difference(self, values: tuple[float, ...], index: int, rows: Array) -> Array:
        """By a forward difference."""
        step = _STEP * max(self.frame, abs(values[index]))
        after = self.run((*values[:index], values[index] + step, *values[index + 1 :]))
        return (after - rows) / step

    def _ready(self, values: tuple[float, ...]) -> tuple[Compiled, tuple[float, ...], list[int]]:
        """The compiled loop, the values that are free in it, and the places among them of those it is smooth in.

        Values that shape the grid are numbers, but for times of jumps and constant delays; a delay of 0 that
        needs a history is a wire.
        """
        every = tuple(self._numbers(values).values())
        shaping = self._shaping_among(self._paths)
        fixed = [k for k in shaping if not self._moves(self._paths[k], every[k])]
        kept = [index for index in range(len(every)) if index not in fixed]
        compiled = self._without_grid(every, fixed, kept)._prepared(tuple(every[k] for k in kept))
        kept = [k for k in kept if self._paths[k] not in self._late_paths]
        return compiled, tuple(every[k] for k in kept), [kept.index(k) for k in kept if k not in shaping]

    @cached_property
    def _late(self) -> tuple[Element, ...]:
        """Delays of columns, which need no history."""
        return delayed_columns(self.loop, self.stimuli)

    @cached_property
    def _late_paths(self) -> frozenset[str]:
        return frozenset(f"{e.path}.delay" for e in self._late)

    def _driven(self, numbers: Mapping[str, float], others: Mapping[str, Stimulus] = {}) -> dict[str, Stimulus]:
        """What drives the loop without these delays, for these values of the paths; others: in the place of some."""
        seconds = {e.name: numbers.get(f"{e.path}.delay", e.block.delay) for e in self._late}
        return driven_late({**self.stimuli, **others}, self._late, seconds)

    def _numbers(self, values: tuple[float, ...]) -> dict[str, float]:
        """Every value that a run takes, by path."""
        return dict(zip(self.free, values, strict=True)) | dict(self.bound)

    @property
    def _paths(self) -> tuple[str, ...]:
        """Of all values that a run takes: the free ones, then those that are bound."""
        return (*self.free, *(path for path, _ in self.bound))

    def _moves(self, path: str, value: float) -> bool:
        """Whether a value that shapes the grid may move it without a new step."""
        return path in self._jump_paths or path in self._late_paths or (path in self._delay_paths and value > 0)

    def _prepared(self, values: tuple[float, ...]) -> Compiled:
        numbers = dict(zip(self._paths, values, strict=True))
        rest = tuple(self._key(path, number) for path, number in numbers.items())
        moving = self._delay_paths | self._jump_paths
        shape = tuple(number for path, number in numbers.items() if path in moving)
        if (rest, shape) not in self._compiled:
            found = self._moved(rest, numbers) if shape else None
            if len(self._compiled) > KEPT:
                del self._compiled[next(iter(self._compiled))]
            self._compiled[rest, shape] = found or self._anew_compiled(numbers)
        return self._compiled[rest, shape]

    def _moved(self, rest: Any, numbers: Mapping[str, float]) -> Compiled | None:
        """One that was compiled for other delays and jumps, the last first, where it fits these as well."""
        alike = [one for (other, _), one in self._compiled.items() if other == rest]
        values = tuple(number for path, number in numbers.items() if path not in self._late_paths)
        driven = self._driven(numbers)
        return next((one for last in reversed(alike) if (one := moved(last, values, driven)) is not None), None)

    def _anew_compiled(self, numbers: Mapping[str, float]) -> Compiled:
        loop = with_numbers(self.loop, numbers) if numbers else self.loop
        duration = self.frame * math.ceil(float(self.time[-1]) / self.frame - EVEN)
        compiled = compile_loop(
            replace(without(loop, self._late), frame=self.frame), self._driven(numbers), duration=duration,
            free=tuple(path for path in self._paths if path not in self._late_paths),
            substeps=self.substeps, pace=Pace(STIFF, self.finer, HOLDING, self.steps.get(LAST), self._most_steps),
            short=any(row for row, _ in self.begins) or len(self.time) < BRIEF,
        )  # fmt: skip
        if compiled.by_frame is not None:
            self.steps[LAST] = compiled.by_frame
        return compiled

    @property
    def _most_steps(self) -> int:
        """Of a frame, where each has its own number: as many in a row as a frame may have, however fine frames are."""
        return max(1, math.ceil(MOST * min(1.0, self.frame / self._row_step))) if self._row_step else MOST

    def _key(self, path: str, number: float) -> Any:
        if path in self._stiff_paths:
            return round(math.log(max(abs(number), 1e-300)) / math.log(SETTLED))
        return None

    @cached_property
    def _shaping(self) -> list[int]:
        """Places of the free values that say where a run's steps begin and end."""
        return self._shaping_among(self.free)

    def _shaping_among(self, paths: tuple[str, ...]) -> list[int]:
        homes = [e.path for e in self.loop.elements if isinstance(e.block, Transport | Sampled)]
        return [
            k for k, path in enumerate(paths)
            if path in self._jump_paths or any(path.startswith(f"{home}.") for home in homes)
        ]  # fmt: skip

    @cached_property
    def _jump_paths(self) -> frozenset[str]:
        """Free paths of the times at which blocks jump by themselves."""
        jumping = [e for e in self.loop.elements if hasattr(e.block, "jump_values")]
        times = {f"{e.path}.{name}" for e in jumping for name in e.block.jump_values}
        return frozenset(times & set(self._paths))

    @cached_property
    def _stiff_paths(self) -> frozenset[str]:
        """Paths of values that set how many steps a frame needs."""
        placed = [p for e in self.loop.elements for p in e.modifiers if hasattr(p.modifier, "smoothing")]
        return frozenset(path for path in self.free for p in placed if path.startswith(f"{p.path}."))

    def _rows(self, compiled: Compiled, table: Array) -> Array:
        chosen = [compiled.model.layout.signals.index(name) for name in self.signals]
        found = table[:, chosen]
        if self._row_step:
            every = round(self._row_step / self.frame)
            return found[:: every][: len(self.time)]
        place = np.clip(self.time / self.frame, 0, len(found) - 1)
        left = np.minimum(place.astype(int), len(found) - 2)
        part = (place - left).reshape(-1, *(1,) * (found.ndim - 1))
        return found[left] * (1 - part) + found[left + 1] * part
