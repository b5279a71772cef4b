"""Run a compiled loop: externals sampled at every stage, calls mapped over chunks, rows gathered."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.signals.stimulus import Stimulus, Zero
from delaytools.simulation.affine import affine_rows, is_affine, side_by_side
from delaytools.simulation.anew import Anew, Reset, resets
from delaytools.simulation.initial import initial_formula
from delaytools.simulation.physics import Physics
from delaytools.simulation.schedule import Timing
from delaytools.simulation.unroll import Call

__all__ = ["Compiled", "before_start", "call_at", "initial_state", "mapped_rows", "prepared_data", "run", "trimmed"]

Array = NDArray[np.float64]
ROWS_PER_CHUNK = 500
KEPT_NUMBERS = 1_000_000  # of an input's values that are kept for the next run
FEW = 2  # times fewer units to try than calls to walk: where matrices pay
ROWS_PER_DATA_CHUNK = 100  # building a map of calls that gather costs more than running it


@final
@dataclass(frozen=True)
class Compiled:
    """A loop ready to run for `frames` frames with the stimuli and the delays it was compiled for.

    by_frame: (frames + 1,) steps of each frame, where they differ.
    """

    model: Physics
    call: Call
    timing: Timing
    frames: int
    frame: float
    stimuli: Mapping[str, Stimulus]
    by_frame: NDArray[np.int64] | None = None
    _sampled: dict[str, tuple[Stimulus, list[Array]]] = field(default_factory=dict, repr=False)


def run(
    compiled: Compiled, values: tuple[float, ...] = (), anew: tuple[Anew, ...] = ()
) -> tuple[Array, Array]:
    """(frames + 1,) s and (frames + 1, signals): the rows of the run, for the values of the free paths.

    anew: where states are set to other values on the way (compiled with `short`).
    """
    state = initial_state(compiled, values)
    driven = prepared_data(compiled), np.asarray(values, dtype=float)
    new = resets(anew, compiled.model.layout.states, [call_at(compiled, one.frame) for one in anew], size=len(state))
    rows = mapped_rows(compiled.call, compiled.call.function, state, driven, new)
    table = rows.reshape(-1, len(compiled.model.layout.signals))
    return compiled.frame * np.arange(compiled.frames + 1), trimmed(compiled, table)


def call_at(compiled: Compiled, frame: int) -> int:
    """The first call that begins at a frame, or after it."""
    call = compiled.call
    if call.copies:
        return -(-frame // max(1, call.rows))
    begun = np.flatnonzero(call.grid.row)
    return -(-int(begun[min(frame, len(begun) - 1)]) // call.spans)


def prepared_data(compiled: Compiled) -> Array:
    """(calls, width): what every call takes besides its state."""
    calls, starts, lengths = _spans(compiled)
    data = _external_data(compiled, starts, lengths, calls)
    return data if compiled.call.data is None else np.hstack([data, compiled.call.data[:calls]])


def trimmed(compiled: Compiled, table: Array) -> Array:
    """The rows at the frames of the run, of all that the calls gave."""
    if compiled.call.copies == 0:
        table = table[: len(compiled.call.grid.row)][compiled.call.grid.row]
    return table[: compiled.frames + 1]


def _spans(compiled: Compiled) -> tuple[int, Array, Array]:
    """Calls, and the start and length of every span in them."""
    call, grid = compiled.call, compiled.call.grid
    if call.copies == 0:
        calls = -(-len(grid.start) // call.spans)
        missing = calls * call.spans - len(grid.start)
        start = np.append(grid.start, np.full(missing, grid.start[-1]))
        return calls, start, np.append(grid.length, np.full(missing, grid.length[-1]))
    calls = -(-(compiled.frames + 1) // call.rows)
    one = float(np.sum(grid.length))
    periods = calls * call.copies
    start = (one * np.arange(periods)[:, None] + grid.start[None, :]).ravel()
    return calls, start, np.tile(grid.length, periods)


def _external_data(compiled: Compiled, start: Array, length: Array, calls: int) -> Array:
    """(calls, spans x per_span): values at start (after a jump), middle and end (before it), slopes, time."""
    inputs, names = compiled.call.inputs, compiled.model.layout.externals
    points = [_points(compiled, name, (start, length)) for name in names]
    columns = [values[stage] for stage in range(3) for values in points]
    if inputs.points == 5:
        for weights in _SLOPES:
            for a, b, c, d, e in points:
                five = zip(weights, (a, d, b, e, c), strict=True)
                columns.append(sum(w * v for w, v in five) / 3)
    if compiled.model.needs_time:
        columns.append(start)
    table = np.stack(columns, axis=1) if columns else np.zeros((len(start), 0))
    return table.reshape(calls, -1)


def _points(compiled: Compiled, name: str, spans: tuple[Array, Array]) -> list[Array]:
    """An external input at start, middle and end of every span, and at the quarters where slopes are wanted.

    Kept for the next run while the stimulus is the same.
    """
    stimulus, (start, length) = compiled.stimuli.get(name, Zero()), spans
    known = compiled._sampled.get(name)
    if known is not None and known[0] is stimulus:
        return known[1]
    edge = 1e-9 * compiled.frame
    quarters = ((0.25, 0.0), (0.75, 0.0)) if compiled.call.inputs.points == 5 else ()
    found = [_at(stimulus, start + part * length, edge * side) for part, side in (*_STAGES, *quarters)]
    if len(found) * len(start) < KEPT_NUMBERS:
        compiled._sampled[name] = (stimulus, found)
    return found


_STAGES = ((0.0, 1.0), (0.5, 0.0), (1.0, -1.0))
_SLOPES = ((-25.0, 48.0, -36.0, 16.0, -3.0), (3.0, -16.0, 36.0, -48.0, 25.0))


def _at(stimulus: Stimulus, t: Array, shift: float) -> Array:
    jumpy = shift if len(stimulus.jumps) else 0.0
    return np.asarray(stimulus.value(t + jumpy), dtype=float)


def mapped_rows(
    call: Call, function: ca.Function, state: Array, driven: tuple[Array, Array], new: Sequence[Reset] = ()
) -> Array:
    """(calls, numbers per call) what `function` gives call after call; driven: (data per call, free values).

    new: entries of the state that are set before some of the calls. function: the call's own, or one with tangents.
    """
    data, p = driven
    if FEW * (len(state) + data.shape[1]) < len(data) and call.once("affine", lambda: is_affine(call.function)):
        points = call.once(("points", function.name(), len(state)), lambda: side_by_side(_densely(function)))
        return affine_rows(points, state, driven, new)
    gathers = call.copies == 0 and call.inputs.model.layout.transports
    most = ROWS_PER_DATA_CHUNK if gathers else ROWS_PER_CHUNK
    edges = sorted({0, len(data), *(one.call for one in new if one.call < len(data))})
    chunk = max(1, min(max(np.diff(edges)), most // call.rows))
    key = (function.name(), function.size1_in(0), chunk)
    mapped = call.once(key, lambda: _densely(function).mapaccum(chunk))
    buffer, evaluate = mapped.buffer()
    rows = np.empty((len(data), mapped.size1_out(1)))
    given, made = np.empty((chunk, data.shape[1])), np.empty((chunk, mapped.size1_out(1)))
    states, spread = np.empty((chunk, mapped.size1_out(0))), np.tile(p, (chunk, 1))
    if p.size:
        buffer.set_arg(2, memoryview(spread))
    if given.size:
        buffer.set_arg(1, memoryview(given))
    buffer.set_res(0, memoryview(states))
    buffer.set_res(1, memoryview(made))
    state = np.array(state, dtype=float)
    for first, last in _pieces(edges, chunk):
        for one in (one for one in new if one.call == first):
            state[one.places] = one.values
        if state.size:
            buffer.set_arg(0, memoryview(state))
        given[: last - first], given[last - first :] = data[first:last], data[last - 1]
        evaluate()
        rows[first:last], state = made[: last - first], states[last - first - 1].copy()
    return rows


def _pieces(edges: Sequence[int], chunk: int) -> Sequence[tuple[int, int]]:
    """(first, last) of pieces of at most `chunk` that meet every edge."""
    return [
        (first, min(first + chunk, end))
        for begin, end in pairwise(edges)
        for first in range(begin, end, chunk)
    ]


def _densely(function: ca.Function) -> ca.Function:
    """The function with full outputs, so that its numbers lie where they are expected."""
    if all(function.sparsity_out(k).is_dense() for k in range(2)):
        return function
    given = function.sx_in() if function.is_a("SXFunction") else function.mx_in()
    return ca.Function(function.name(), given, [ca.densify(out) for out in function.call(given)])


def initial_state(compiled: Compiled, values: tuple[float, ...]) -> Array:
    """The state before t = 0: every signal at its initial value, the delays filled with it."""
    call = compiled.call
    formula = call.once("initial", lambda: initial_formula(compiled.model, call.depth))
    return np.asarray(formula(before_start(compiled), np.asarray(values, dtype=float))).ravel()


def before_start(compiled: Compiled) -> Array:
    """(externals,) what drives the loop just before t = 0."""
    moment = np.array([-compiled.frame * 1e-6])
    driven = [compiled.stimuli.get(n, Zero()).value(moment)[0] for n in compiled.model.layout.externals]
    return np.array(driven, dtype=float)
