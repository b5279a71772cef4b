"""The formulas of a loop as CasADi functions of flat vectors: rates, rows, ticks, followers, delayed inputs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import casadi as ca

from delaytools.blocks.block import Continuous, Follower, Sampled, Scalar
from delaytools.loop.linearity import is_linear
from delaytools.loop.loop import Loop
from delaytools.loop.network import Key, Leaves, Network, network
from delaytools.loop.values import resolve

__all__ = ["Layout", "Physics", "physics"]


@final
@dataclass(frozen=True)
class Layout:
    """Which number stands where: continuous states, held outputs, kept states, followers, delays, externals."""

    states: tuple[Key, ...]
    held: tuple[Key, ...]
    kept: tuple[Key, ...]
    followers: tuple[str, ...]
    transports: tuple[str, ...]
    externals: tuple[str, ...]
    signals: tuple[str, ...]


@final
@dataclass(frozen=True)
class Point:
    """Arguments of every function: x, v, d, w, e (columns), t, elapsed, p."""

    x: ca.SX
    v: ca.SX
    d: ca.SX
    w: ca.SX
    e: ca.SX
    t: ca.SX
    elapsed: ca.SX
    p: ca.SX

    @property
    def arguments(self) -> list[ca.SX]:
        """In the order in which the functions take them."""
        return [self.x, self.v, self.d, self.w, self.e, self.t, self.elapsed, self.p]


@final
@dataclass(frozen=True)
class Physics:
    """CasADi functions of (x, v, d, w, e, t, elapsed, p).

    rates: x'. row: named signals. follow: followers' outputs; settled: what enters them. delayed: what enters each
    delay, and its time derivative (which also takes e' and d'). symbol: p, one number per path in `free`.
    linear: whether rates and delayed inputs are linear in (x, v, d, e) and free of time.
    """

    net: Network
    layout: Layout
    free: tuple[str, ...]
    symbol: ca.SX
    rates: ca.Function
    row: ca.Function
    follow: ca.Function
    settled: ca.Function
    delayed: ca.Function
    linear: bool
    needs_time: bool
    needs_slopes: bool

    def tick(self, point: list[Any], kept: Any, ticking: Mapping[str, Scalar]) -> tuple[Any, Any]:
        """v and k after the sampled blocks in `ticking` (element -> 1 or flag) have updated."""
        leaves = _leaves(self.layout, Point(*point))
        before = {key: kept[i] for i, key in enumerate(self.layout.kept)}
        held, new = self.net.tick(leaves, before, ticking)
        return _stack([held[key] for key in self.layout.held]), _stack([new[key] for key in self.layout.kept])


def _stack(items: list[Any]) -> ca.SX:
    return ca.vertcat(*[ca.SX(item) for item in items]) if items else ca.SX(0, 1)


def layout_of(net: Network) -> Layout:
    """The flat layout of a network's states and signals."""
    loop = net.loop
    states = [(e.name, s) for e in loop.continuous if isinstance(e.block, Continuous) for s in e.block.states]
    held = [(e.name, port) for e in loop.sampled for port in e.block.outputs]
    kept = [(e.name, s) for e in loop.sampled if isinstance(e.block, Sampled) for s in e.block.states]
    followers = [e.name for e in loop.elements if isinstance(e.block, Follower)]
    transports = [e.name for e in loop.transports]
    return Layout(
        tuple(states),
        tuple(held),
        tuple(kept),
        tuple(followers),
        tuple(transports),
        loop.externals,
        loop.signals,
    )


def _symbols(layout: Layout, free: tuple[str, ...]) -> Point:
    sizes = {
        "x": len(layout.states),
        "v": len(layout.held),
        "d": len(layout.transports),
        "w": len(layout.followers),
        "e": len(layout.externals),
        "t": 1,
        "elapsed": 1,
        "p": len(free),
    }
    return Point(**{name: ca.SX.sym(name, size) for name, size in sizes.items()})


def _leaves(layout: Layout, point: Point) -> Leaves:
    def named(keys: tuple[Any, ...], vector: ca.SX) -> dict[Any, Scalar]:
        return {key: vector[i] for i, key in enumerate(keys)}

    return Leaves(
        t=point.t,
        states=named(layout.states, point.x),
        held=named(layout.held, point.v),
        delayed=named(layout.transports, point.d),
        memories=named(layout.followers, point.w),
        externals=named(layout.externals, point.e),
        elapsed=point.elapsed,
    )


def physics(loop: Loop, free: tuple[str, ...] = ()) -> Physics:
    """The loop's formulas, with the values at the paths in `free` as symbols."""
    p = ca.SX.sym("p", len(free))
    net = network(resolve(loop, {path: p[i] for i, path in enumerate(free)}))
    layout = layout_of(net)
    point = _symbols(layout, free)
    point = Point(point.x, point.v, point.d, point.w, point.e, point.t, point.elapsed, p)
    leaves = _leaves(layout, point)
    known = net.signals(leaves)
    rates = net.rates(leaves, known)
    x_dot = _stack([rates[key] for key in layout.states])
    rows = _stack([known[name] for name in layout.signals])
    memory = _stack([known[net.elements[name].outputs["output"]] for name in layout.followers])
    followers = [net.elements[name] for name in layout.followers]
    settled = _stack([net.input(e, e.block.inputs[0], known) for e in followers])
    inputs = _stack(
        [net.input(net.elements[n], net.elements[n].block.inputs[0], known) for n in layout.transports]
    )
    delayed, slopes = _with_derivative(point, inputs, x_dot, free)
    args = point.arguments
    moving = ca.vertcat(point.x, point.v, point.d, point.e)
    clock = ca.vertcat(point.t, point.elapsed)
    both = ca.vertcat(x_dot, inputs)
    timed = bool(ca.depends_on(ca.vertcat(both, rows), clock)) if both.shape[0] + rows.shape[0] else False
    kept = {key: ca.SX.sym("kept") for key in layout.kept}
    updates = _stack([x for part in net.tick(leaves, kept, {e.name: 1 for e in loop.sampled}) for x in part.values()])
    ticks_timed = bool(ca.depends_on(updates, clock)) if updates.shape[0] else False
    linear = not layout.followers and not timed and not free and is_linear(both, moving)
    return Physics(
        net,
        layout,
        free,
        p,
        ca.Function("rates", args, [x_dot]),
        ca.Function("row", args, [rows]),
        ca.Function("follow", args, [memory]),
        ca.Function("settled", args, [settled]),
        delayed,
        linear,
        timed or ticks_timed,
        slopes,
    )


def _with_derivative(
    point: Point, inputs: ca.SX, x_dot: ca.SX, free: tuple[str, ...]
) -> tuple[ca.Function, bool]:
    e_dot = ca.SX.sym("e_dot", point.e.shape[0])
    d_dot = ca.SX.sym("d_dot", point.d.shape[0])
    total = ca.SX.zeros(inputs.shape[0], 1)
    pairs = [
        (point.x, x_dot),
        (point.e, e_dot),
        (point.d, d_dot),
        (point.t, ca.SX.ones(1, 1)),
        (point.elapsed, ca.SX.ones(1, 1)),
    ]
    for variable, velocity in pairs:
        if variable.shape[0] and inputs.shape[0]:
            total = total + ca.jtimes(inputs, variable, velocity)
    function = ca.Function("delayed", [*point.arguments, e_dot, d_dot], [inputs, total])
    return function, bool(inputs.shape[0]) and bool(ca.depends_on(inputs, ca.vertcat(point.e, point.t)))
