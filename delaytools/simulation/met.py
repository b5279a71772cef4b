"""How many steps each frame of a run asks for, by how stiff the loop is where the run goes."""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.loop.network import Network
from delaytools.signals.expression import NUMPY
from delaytools.signals.stimulus import Zero
from delaytools.simulation.run import Compiled, initial_state, mapped_rows, prepared_data
from delaytools.simulation.timing import fastest_at

__all__ = ["steps_needed"]

Array = NDArray[np.float64]


def steps_needed(compiled: Compiled, stiffness: float) -> Array:
    """(frames + 1,) steps so that no |λ| h is above `stiffness` where a run without free values goes.

    Where a state passes through rest, or comes near it, also with it at rest: friction is stiffest there. Infinitely
    many where the run diverges.
    """
    states, rows = _walked(compiled)
    if not np.isfinite(states).all():
        return np.full(compiled.frames + 1, np.inf)
    time = _begun(compiled, len(states))
    points = _points(compiled, states, rows, time)
    fastest = fastest_at(compiled.model, points)
    change = np.abs(np.diff(states, axis=0, append=states[-1:]))
    for k in range(states.shape[1]):
        near = np.flatnonzero(np.abs(states[:, k]) <= change[:, k])
        if len(near):
            resting = np.where(np.arange(states.shape[1]) == k, 0.0, states[near])
            at_rest = fastest_at(compiled.model, [resting, *(rows[near] for rows in points[1:])])
            fastest[near] = np.maximum(fastest[near], at_rest)
    met = np.zeros(compiled.frames + 1)
    np.maximum.at(met, np.minimum((time / compiled.frame + 1e-6).astype(int), compiled.frames), fastest)
    return np.ceil(met * compiled.frame / stiffness - 1e-9).clip(1.0)


def _begun(compiled: Compiled, count: int) -> Array:
    """(count,) s at which the calls begin."""
    call, begun = compiled.call, np.arange(count)
    return begun * call.rows * compiled.frame if call.copies else call.grid.start[begun * call.spans]


def _walked(compiled: Compiled) -> tuple[Array, dict[str, Array]]:
    """(calls, states) at the beginning of every call of a run without free values, and the signals there."""
    call, first = compiled.call, initial_state(compiled, ())
    arguments, signals = call.function.mx_in(), compiled.model.layout.signals
    after, rows = call.function.call(arguments)
    size = len(compiled.model.layout.states)
    walk = ca.Function("walk", arguments, [after, ca.vertcat(after[:size], rows[: len(signals)])])
    table = mapped_rows(call, walk, first, (prepared_data(compiled), np.zeros(0)))
    return np.vstack([first[:size], table[:-1, :size]]), dict(zip(signals, table[:, size:].T, strict=True))


def _points(compiled: Compiled, states: Array, rows: Mapping[str, Array], time: Array) -> list[Array]:
    """Per argument of the rates (calls, size): where the run is at the beginning of every call."""
    model, layout = compiled.model, compiled.model.layout

    def written(keys: Sequence[tuple[str, str]]) -> Array:
        found = [_written(model.net, rows, key) for key in keys]
        return np.stack(found, axis=1) if found else np.zeros((len(time), 0))

    def only(names: Sequence[str]) -> Array:
        return written([(name, model.net.elements[name].block.outputs[0]) for name in names])

    driven = [compiled.stimuli.get(name, Zero()).value(time) for name in layout.externals]
    external = np.stack(driven, axis=1) if driven else np.zeros((len(time), 0))
    apart = time[:, None]
    return [states, written(layout.held), only(layout.transports), only(layout.followers), external, apart,
            0 * apart, np.zeros((len(time), 0))]  # fmt: skip


def _written(net: Network, rows: Mapping[str, Array], key: tuple[str, str]) -> Array:
    """What a block writes at some rows; where that is a joint of no name, what enters the block."""
    element = net.elements[key[0]]
    signal = element.outputs[key[1]]
    if signal in rows:
        return rows[signal]
    entering = element.inputs[element.block.inputs[0]]
    known = {**net.loop.parameters, **rows}
    if not all(name in known for name in entering.names):
        return np.zeros(len(next(iter(rows.values()), ())))
    return np.asarray(entering.evaluate(known, NUMPY), dtype=float)
