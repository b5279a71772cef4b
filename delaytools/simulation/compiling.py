"""A loop made ready to run: its formulas, its grid, and as many steps as its stiffness asks for."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from delaytools.loop.loop import Loop
from delaytools.signals.stimulus import Column, Constant, Stimulus, Zero
from delaytools.simulation.from_data import data_call, moved_data
from delaytools.simulation.met import steps_needed
from delaytools.simulation.physics import Physics, physics
from delaytools.simulation.repeating import moved_repeating, repeating_call
from delaytools.simulation.run import Compiled
from delaytools.simulation.schedule import Timing
from delaytools.simulation.timing import (
    MOST,
    STIFFNESS,
    bends,
    delays_of,
    jumps_of,
    stiffens,
    timing_of,
    with_delays,
    with_jumps,
)

__all__ = ["Pace", "compile_loop", "moved"]

Array = NDArray[np.float64]
SHORTLY = 2.0  # times the |λ| h elsewhere that a step may have where friction is stiffest under the largest load
WORTH_IT = 2.5  # times the mean steps of a frame those of the stiffest: from here on each frame gets its own number
ALIKE = 1.3  # times the steps that are needed: so many are kept, since runs on one grid differ by their values alone
BESIDE = 3  # frames on either side that get the steps of a stiffer one: other values bring its states there
ROUNDS = 4  # runs in which the steps that each frame needs are found
FEW = 0.03  # of the frames: where so few asked for more, what sticks and slips would ask elsewhere the next time


@final
@dataclass(frozen=True, eq=False)
class Pace:
    """How long steps are: so that no |λ| h is above `stiffness`, and `finer` times shorter than that.

    holding: times that |λ| h where friction makes a loop stiff at rest: what it holds creeps. by_frame: (frames + 1,)
    steps of each frame from which the search for them begins: those of a loop that goes nearly where this one goes.
    most: steps of a frame, where each has its own number.
    """

    stiffness: float = STIFFNESS
    finer: int = 1
    holding: float = 1.0
    by_frame: NDArray[np.int64] | None = None
    most: int = MOST


USUAL = Pace()
NOTHING_LOST = Constant(1.0)  # draws that nobody gives: on a log, what was lost is not known


def compile_loop(
    loop: Loop,
    stimuli: Mapping[str, Stimulus],
    *,
    duration: float,
    free: tuple[str, ...] = (),
    substeps: int | None = None,
    pace: Pace = USUAL,
    short: bool = False,
) -> Compiled:
    """The loop as one CasADi step, for runs of `duration` s; values at the paths in `free` stay symbols.

    substeps: of a frame; None: at this pace. short: calls as short as the grid allows, so that a run can begin anew
    between any two of them.
    """
    stimuli = {**dict.fromkeys(loop.random, NOTHING_LOST), **stimuli}
    model = physics(loop, free)
    numeric = physics(loop) if free else model
    jumps = {name: np.asarray(stimuli[name].jumps) for name in model.layout.externals if name in stimuli}
    delays = {name: column for name in model.layout.transports if (column := _column(model, name, stimuli))}
    wakes = _wakes(numeric, stimuli, loop.frame)
    friction = pace.holding if model.layout.transports and bends(numeric) else 1.0  # stiffest at rest, where runs begin
    timing = timing_of(
        numeric, jumps, substeps=substeps, stiffness=friction * pace.stiffness, delays=delays, wakes=wakes
    )
    frames = round(duration / loop.frame)

    def made(model: Physics, timing: Timing, short: bool = short) -> Compiled:
        end = (frames + 1) * loop.frame
        call = repeating_call(model, timing, short=short) or data_call(model, timing, end, short=short)
        return Compiled(model, call, timing, frames, loop.frame, stimuli)

    needed = None  # delays would carry along the history of all steps
    if substeps is None and not model.layout.transports and bends(numeric):
        begun = pace.by_frame if pace.by_frame is not None and len(pace.by_frame) == frames + 1 else None
        own = partial(made, numeric, short=True)
        needed = _needed(own, replace(timing, by_frame=begun), pace)
    if needed is not None:
        uneven = needed.max() >= WORTH_IT * needed.mean()
        timing = replace(timing, by_frame=needed) if uneven else replace(timing, substeps=int(needed.max()))
    elif substeps is None and stiffens(numeric):
        met = float(steps_needed(made(numeric, timing), SHORTLY * pace.stiffness).max())
        timing = replace(timing, substeps=int(min(MOST, max(met, timing.substeps))))
    return replace(made(model, timing.finer(pace.finer)), by_frame=timing.by_frame)


def moved(
    compiled: Compiled, values: tuple[float, ...], stimuli: Mapping[str, Stimulus] | None = None
) -> Compiled | None:
    """The loop ready to run with other constant delays and times of jumps, nothing compiled anew; None where its calls
    do not fit them.

    values: of the free paths; what shapes the grid otherwise is as it was. stimuli: others of the same kind, which may
    jump at other times.
    """
    driven = {**compiled.stimuli, **(stimuli or {})}
    call, end = compiled.call, (compiled.frames + 1) * compiled.frame
    seconds = call.once("seconds", lambda: delays_of(compiled.model))(np.asarray(values, dtype=float))
    times = call.once("jumps", lambda: jumps_of(compiled.model))(np.asarray(values, dtype=float))
    timing = with_delays(compiled.timing, np.asarray(seconds).ravel())
    timing = with_jumps(timing, compiled.model, np.asarray(times).ravel())
    given = {name: np.asarray(driven[name].jumps) for name in timing.jumps if name in driven}
    timing = replace(timing, jumps={**timing.jumps, **given})
    other = moved_repeating(call, timing) if call.copies else moved_data(call, compiled.model, timing, end)
    if other is None:
        return None
    start, last = other.grid.start, call.grid.start
    same = len(start) == len(last) and bool(np.abs(start - last).max() < 1e-9 * compiled.frame)
    return replace(compiled, call=other, timing=timing, stimuli=driven, _sampled=compiled._sampled if same else {})


def _needed(made: Callable[[Timing], Compiled], timing: Timing, pace: Pace) -> NDArray[np.int64] | None:
    """(frames + 1,) as many steps in every frame as a run that has them asks for; None where it diverges.

    Where nothing is known the first run has one step in every frame: too few where it is stiff, but not far off.
    """
    needed = np.ones(1, dtype=np.int64) if timing.by_frame is None else timing.by_frame
    for _ in range(ROUNDS):
        met = steps_needed(made(replace(timing, by_frame=needed)), pace.holding * pace.stiffness)
        if not np.isfinite(met).all():
            return None
        met = np.minimum(met, pace.most).astype(np.int64)
        found = maximum_filter1d(met, 2 * BESIDE + 1)
        if (met <= needed).all():
            return needed if len(needed) == len(found) and needed.sum() <= ALIKE * found.sum() else found
        short, needed = float(np.mean(met > needed)), np.maximum(found, needed)
        if short < FEW:
            break
    return needed


def _wakes(model: Physics, stimuli: Mapping[str, Stimulus], frame: float) -> bool:
    """Whether a state or an external input moves from t = 0 on."""
    around = np.array([-1e-6, 1e-3]) * frame
    values = [stimuli.get(name, Zero()).value(around) for name in model.layout.externals]
    if any(pair[0] != pair[1] for pair in values):
        return True
    states = [float(s) for e in model.net.loop.continuous for s in e.block.initial_state]
    zeros = [np.zeros(model.rates.size_in(i)[0]) for i in range(8)]
    zeros[0], zeros[4] = np.array(states), np.array([pair[0] for pair in values])
    return bool(np.any(np.asarray(model.rates(*zeros)) != 0))


def _column(model: Physics, name: str, stimuli: Mapping[str, Stimulus]) -> tuple[Array, Array] | None:
    inputs = model.net.elements[name].inputs
    if "delay" not in inputs:
        return None
    stimulus = stimuli.get(inputs["delay"].text)
    return (stimulus.time, stimulus.values) if isinstance(stimulus, Column) else None
