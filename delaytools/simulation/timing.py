"""What the grid of a run needs to know of a loop: periods, delays, sharp arrivals, steps per frame."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import Sampled, Transport
from delaytools.simulation.physics import Physics
from delaytools.simulation.schedule import Arrival, Timing

__all__ = [
    "MOST", "STIFFNESS", "bends", "delays_of", "fastest_at", "jumps_of", "stiffens", "timing_of", "with_delays",
    "with_jumps",
]  # fmt: skip

Array = NDArray[np.float64]
MOST = 100  # steps per frame
MAPPED = 1000  # points at a time
STIFFNESS = 0.5  # largest |λ| h of one Runge–Kutta step
START = "start of the run"
SHARPEST = 3  # a jump in this derivative of a delayed signal no longer lowers the order of a Runge–Kutta step


def timing_of(
    model: Physics,
    jumps: Mapping[str, Array],
    *,
    substeps: int | None = None,
    stiffness: float = STIFFNESS,
    delays: Mapping[str, tuple[Array, Array]] | None = None,
    wakes: bool = False,
) -> Timing:
    """The timing of a loop whose values are all numbers.

    jumps: external signal -> times at which it jumps. stiffness: |λ| h of a step where substeps are not given.
    delays: transport -> (times, seconds) from a column. wakes: whether anything moves from t = 0 on, so that
    delayed signals have a kink there.
    """
    net = model.net
    periods = {e.name: float(e.block.period) for e in net.loop.sampled if isinstance(e.block, Sampled)}
    functions, constants = [], []
    for name in model.layout.transports:
        function, number = _delay_function(net.elements[name].block, (delays or {}).get(name))
        functions.append(function)
        constants.append(number)
    moments = {name: np.asarray(times) for name, times in jumps.items() if len(times)}
    moments |= {e.name: np.asarray(e.block.jumps) for e in net.loop.continuous if hasattr(e.block, "jumps")}
    if wakes:
        moments[START] = np.zeros(1)
    arrivals = sharp_arrivals(model, tuple(moments))
    count = substeps or _substeps(model, stiffness)
    return Timing(net.loop.frame, periods, tuple(functions), tuple(constants), arrivals, moments, count)


def delays_of(model: Physics) -> ca.Function:
    """values of the free paths -> (delays,) s, NaN where one varies."""
    blocks = [model.net.elements[name].block for name in model.layout.transports]
    formulas = [math.nan if one.varies else one.seconds(0.0, []) for one in blocks if isinstance(one, Transport)]
    return ca.Function("seconds", [model.symbol], [ca.densify(ca.vertcat(ca.SX(0, 1), *formulas))])


def with_delays(timing: Timing, seconds: Array) -> Timing:
    """The timing with other constant delays (delays,) s; those that vary (NaN) stay."""
    delays = [
        old if math.isnan(number) else _constant(number)
        for old, number in zip(timing.delays, seconds.tolist(), strict=True)
    ]
    return replace(timing, delays=tuple(delays), constant=tuple(seconds.tolist()))


def jumps_of(model: Physics) -> ca.Function:
    """values of the free paths -> the times at which blocks jump by themselves, s, element by element."""
    times = [ca.vertcat(*e.block.jumps) for e in _jumping(model)]
    return ca.Function("jumps", [model.symbol], [ca.densify(ca.vertcat(ca.SX(0, 1), *times))])


def with_jumps(timing: Timing, model: Physics, times: Array) -> Timing:
    """The timing with other times of the jumps that blocks bring, as `jumps_of` gives them."""
    moments, at = dict(timing.jumps), 0
    for element in _jumping(model):
        count = len(element.block.jumps)
        moments[element.name] = times[at : at + count]
        at += count
    return replace(timing, jumps=moments)


def _jumping(model: Physics) -> list[Any]:
    return [e for e in model.net.loop.continuous if hasattr(e.block, "jumps")]


def _constant(number: float) -> Callable[[Array], Array]:
    return lambda t: np.full(np.shape(t), number)


def _delay_function(block: Any, column: tuple[Array, Array] | None) -> tuple[Any, float]:
    assert isinstance(block, Transport)
    if column is not None:
        times, seconds = column
        return (lambda t: np.maximum(np.interp(t, times, seconds), 0.0)), math.nan
    if not block.varies:
        number = float(block.seconds(0.0, []))
        return _constant(number), number
    return (lambda t: np.asarray(block.seconds(t, []))), math.nan


def _substeps(model: Physics, stiffness: float) -> int:
    """Steps per frame so that |λ| h stays within `stiffness` at the initial point."""
    if not model.layout.states:
        return 1
    others = [np.zeros((1, model.rates.size1_in(i))) for i in range(1, 8)]
    fastest = fastest_at(model, [np.zeros((1, len(model.layout.states))), *others])[0]
    return max(1, min(MOST, math.ceil(fastest * model.net.loop.frame / stiffness - 1e-9)))


def fastest_at(model: Physics, points: Sequence[Array]) -> Array:
    """(points,) the largest |λ|, rad/s, at points without free values: per argument of the rates (points, size)."""
    size, count = len(model.layout.states), len(points[0])
    around = [ca.SX.sym(f"a{i}", model.rates.size1_in(i)) for i in range(8)]
    jacobian = ca.Function("jacobian", around, [ca.densify(ca.jacobian(model.rates(*around), around[0]).T)])
    chunk = min(count, MAPPED)  # a map of many points takes longer to build than to evaluate
    mapped, columns = jacobian.map(chunk), np.empty((-(-count // chunk) * chunk, size, size))
    buffer, evaluate = mapped.buffer()
    for first in range(0, count, chunk):
        given = [np.zeros((chunk, rows.shape[1])) for rows in points]
        for place, (rows, every) in enumerate(zip(given, points, strict=True)):
            rows[: count - first] = every[first : first + chunk]
            if rows.size:
                buffer.set_arg(place, memoryview(rows))
        buffer.set_res(0, memoryview(columns[first : first + chunk]))
        evaluate()
    columns = columns[:count]
    return _radius(np.nan_to_num(columns))


def _radius(matrices: Array) -> Array:
    """(n,) spectral radius of (n, k, k); where k = 2 by the roots of λ² - trace λ + determinant."""
    if matrices.shape[1] != 2:
        return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=1))
    half = 0.5 * (matrices[:, 0, 0] + matrices[:, 1, 1])
    determinant = matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0]
    root = np.sqrt((half**2 - determinant).astype(complex))
    return np.asarray(np.maximum(np.abs(half + root), np.abs(half - root)))


def stiffens(model: Physics) -> bool:
    """Whether what drives the loop changes how stiff it is, as friction by load does."""
    slopes, states, driven = _slopes(model)
    return states.numel() > 0 and driven.numel() > 0 and bool(any(ca.which_depends(slopes, driven, 1, False)))


def bends(model: Physics) -> bool:
    """Whether it is stiffer at some states, or as it is driven, than at others."""
    slopes, states, driven = _slopes(model)
    moving = ca.vertcat(states, driven)
    return states.numel() > 0 and bool(any(ca.which_depends(slopes, moving, 1, False)))


def _slopes(model: Physics) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The rates' derivatives by the states, the states, and what drives them."""
    point = [ca.SX.sym(f"o{i}", model.rates.size1_in(i)) for i in range(8)]
    return ca.vec(ca.jacobian(model.rates(*point), point[0])), point[0], ca.vertcat(point[4], point[1], point[2])


def sharp_arrivals(model: Physics, jumping: tuple[str, ...]) -> tuple[Arrival, ...]:
    """Events (ticks of sampled blocks, jumps of inputs) and the delays through which they still arrive sharply.

    A jump in the k-th derivative of what enters a delay lowers the order of the method where k < 3; every
    integration raises k by one, a delay leaves it.
    """
    order, leaves = _smoothness(model)
    sources = [(key[0], leaf) for leaf, key in enumerate(leaves) if key[1] == "held"]
    sources += [
        (key[0], leaf) for leaf, key in enumerate(leaves) if key[1] == "external" and key[0] in jumping
    ]
    sources += [(e.name, len(leaves) - 1) for e in model.net.loop.continuous if e.name in jumping]
    first = {key: i for i, key in enumerate(leaves)}
    found: dict[tuple[str, tuple[int, ...]], int] = {}
    for source, leaf in sources:
        _follow_delays(order, first, (source, (), leaf, 0), found)
    if START in jumping:
        for delay in range(order.shape[0]):
            found[START, (delay,)] = 1
            _follow_delays(order, first, (START, (delay,), first[delay, "delay"], 1), found)
    return tuple(Arrival(source, through) for source, through in found)


def _follow_delays(
    order: Array, first: dict, here: tuple[str, tuple[int, ...], int, int], found: dict
) -> None:
    source, through, leaf, sharp = here
    for delay in range(order.shape[0]):
        total = sharp + order[delay, leaf]
        path = (*through, delay)
        if total >= SHARPEST or len(path) > 12 or found.get((source, tuple(sorted(path))), 99) <= total:
            continue
        found[source, tuple(sorted(path))] = int(total)
        _follow_delays(order, first, (source, path, first[delay, "delay"], int(total)), found)


def _smoothness(model: Physics) -> tuple[Array, list[tuple[Any, str]]]:
    """(delays, leaves) the least number of integrations from a leaf to what enters a delay, and the leaves."""
    layout = model.layout
    leaves: list[tuple[Any, str]] = [(name, "held") for name, _ in layout.held]
    leaves += [(i, "delay") for i in range(len(layout.transports))]
    leaves += [(name, "external") for name in layout.externals]
    leaves.append(("time", "time"))
    point = [ca.SX.sym(f"a{i}", *model.rates.size_in(i)) for i in range(8)]
    chosen = ca.vertcat(point[1], point[2], point[4], point[5])
    rates, inputs = model.rates(*point), _delay_inputs(model, point)
    state_leaf = _pattern(rates, chosen)
    state_leaf[:, -1] |= _depends(rates, point[5])  # a comparison with time has no derivative, but jumps
    state_state = _pattern(rates, point[0])
    depth = np.where(state_leaf, 1.0, np.inf)
    for _ in range(len(layout.states)):
        step = np.min(np.where(state_state[:, :, None], depth[None], np.inf), axis=1, initial=np.inf) + 1
        depth = np.minimum(depth, step)
    entering = _pattern(inputs, chosen)
    entering[:, -1] |= _depends(inputs, point[5])
    direct = np.where(entering, 0.0, np.inf)
    through = _pattern(inputs, point[0])
    best = np.min(np.where(through[:, :, None], depth[None], np.inf), axis=1, initial=np.inf)
    return np.minimum(direct, best), leaves


def _delay_inputs(model: Physics, point: list[ca.SX]) -> ca.SX:
    zeros = [ca.SX.zeros(*model.delayed.size_in(i)) for i in (8, 9)]
    return model.delayed(*point, *zeros)[0]


def _depends(formula: ca.SX, variable: ca.SX) -> NDArray[np.bool_]:
    return np.array([bool(ca.depends_on(formula[i], variable)) for i in range(formula.shape[0])], dtype=bool)


def _pattern(formula: ca.SX, variable: ca.SX) -> NDArray[np.bool_]:
    if formula.shape[0] == 0 or variable.shape[0] == 0:
        return np.zeros((formula.shape[0], variable.shape[0]), dtype=bool)
    sparsity = ca.jacobian_sparsity(formula, variable)
    return np.array(ca.DM(sparsity, 1)).astype(bool)
