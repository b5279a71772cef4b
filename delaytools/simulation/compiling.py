"""A loop made ready to run: its formulas, its grid, and as many steps as its stiffness asks for."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from delaytools.loop.loop import Loop
from delaytools.signals.stimulus import Column, Stimulus, Zero
from delaytools.simulation.from_data import data_call
from delaytools.simulation.met import steps_needed
from delaytools.simulation.physics import Physics, physics
from delaytools.simulation.repeating import repeating_call
from delaytools.simulation.run import Compiled
from delaytools.simulation.schedule import Timing
from delaytools.simulation.timing import MOST, STIFFNESS, bends, stiffens, timing_of

__all__ = ["compile_loop"]

Array = NDArray[np.float64]
SHORTLY = 2.0  # times the |λ| h elsewhere that a step may have where friction is stiffest under the largest load
WORTH_IT = 3  # steps of the stiffest frame from which on it pays to give each frame its own number
ROUNDS = 4  # runs in which the steps that each frame needs are found


def compile_loop(
    loop: Loop,
    stimuli: Mapping[str, Stimulus],
    *,
    duration: float,
    free: tuple[str, ...] = (),
    substeps: int | None = None,
    stiffness: float = STIFFNESS,
    finer: int = 1,
    short: bool = False,
) -> Compiled:
    """The loop as one CasADi step, for runs of `duration` s; values at the paths in `free` stay symbols.

    substeps: of a frame; None: so that no |λ| h is above `stiffness`. finer: by what these are multiplied. short: calls
    as short as the grid allows, so that a run can begin anew between any two of them.
    """
    model = physics(loop, free)
    numeric = physics(loop) if free else model
    jumps = {name: np.asarray(stimuli[name].jumps) for name in model.layout.externals if name in stimuli}
    delays = {name: column for name in model.layout.transports if (column := _column(model, name, stimuli))}
    wakes = _wakes(numeric, stimuli, loop.frame)
    timing = timing_of(numeric, jumps, substeps=substeps, stiffness=stiffness, delays=delays, wakes=wakes)
    frames = round(duration / loop.frame)

    def made(model: Physics, timing: Timing, short: bool = short) -> Compiled:
        end = (frames + 1) * loop.frame
        call = repeating_call(model, timing, short=short) or data_call(model, timing, end, short=short)
        return Compiled(model, call, frames, loop.frame, stimuli)

    needed = None
    if substeps is None and not model.layout.transports and bends(numeric):
        needed = _needed(partial(made, numeric, short=True), timing, stiffness)
    if needed is not None:
        uneven = needed.max() >= WORTH_IT
        timing = replace(timing, by_frame=needed) if uneven else replace(timing, substeps=int(needed.max()))
    elif substeps is None and stiffens(numeric):
        met = float(steps_needed(made(numeric, timing), SHORTLY * stiffness).max())
        timing = replace(timing, substeps=int(min(MOST, max(met, timing.substeps))))
    return made(model, timing.finer(finer))


def _needed(made: Callable[[Timing], Compiled], timing: Timing, stiffness: float) -> NDArray[np.int64] | None:
    """(frames + 1,) as many steps in every frame as a run that has them asks for; None where it diverges.

    The first run has one step in every frame: too few where it is stiff, but it goes nearly there.
    """
    needed = np.ones(1)
    for _ in range(ROUNDS):
        found = steps_needed(made(replace(timing, by_frame=needed.astype(np.int64))), stiffness)
        if not np.isfinite(found).all():
            return None
        enough = bool((found <= needed).all())
        needed = np.minimum(found if enough else np.maximum(found, needed), MOST)
        if enough:
            break
    return needed.astype(np.int64)


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
