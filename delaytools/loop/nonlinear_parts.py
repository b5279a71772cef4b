"""A loop parted into a linear rest and the nonlinear pieces in it, each a formula of few arguments or a memory."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import final

import casadi as ca
import numpy as np

from delaytools.blocks.block import Block, Continuous, Follower, Scalar, specifications
from delaytools.blocks.gain import Gain
from delaytools.blocks.state_space import StateSpace
from delaytools.loop.linearity import nonlinear_in
from delaytools.loop.loop import Element, Loop
from delaytools.loop.modifier import LIMIT
from delaytools.loop.network import Leaves, network
from delaytools.loop.values import resolve
from delaytools.signals.expression import signal_expression

__all__ = ["NonlinearPart", "Parted", "parted"]


@final
@dataclass(frozen=True, eq=False)
class NonlinearPart:
    """One nonlinear piece of a loop.

    name: of the block, or of the effects (`TYPE@PORT`) that make it nonlinear. arguments: signals of the rest that it
    reads. results: external inputs of the rest that it drives. formula: (arguments) -> results, vectors; of a piece
    with memory (memory, arguments before, arguments now, seconds between) -> (memory, results). block: the whole block,
    where the piece is just that; else None. memory: numbers that it remembers. times: s, the shortest and the longest
    in which what it remembers moves by itself.
    """

    name: str
    arguments: tuple[str, ...]
    results: tuple[str, ...]
    formula: ca.Function
    block: Block | None
    memory: int = 0
    times: tuple[float, float] = (0.0, 0.0)

    @property
    def in_a_wire(self) -> bool:
        """Whether the piece is a block that is a wire at its neutral value."""
        specs = specifications(self.block).values() if self.block is not None else ()
        return any(spec.neutral is not None for spec in specs) or bool(getattr(self.block, "neutral", None))


@final
@dataclass(frozen=True, eq=False)
class Parted:
    """rest: the loop with the pieces taken out, linear (or affine) but for sampled blocks; parts: the pieces."""

    rest: Loop
    parts: tuple[NonlinearPart, ...]


def parted(loop: Loop) -> Parted:
    """The loop as a linear rest and its nonlinear pieces: what the rest writes to them, and what they give back.

    A row (a derivative or an output) of a block, with the effects on it, is linear in some of what it reads; what is
    left depends on few: these are the piece's arguments, and it is added to the row again as an external input.
    Formulas of time are taken at t = 0. Sampled blocks and delays stay in the rest as they are.
    """
    loop = resolve(loop)
    elements: list[Element] = []
    parts: list[NonlinearPart] = []
    for element in loop.elements:
        if isinstance(element.block, Follower):
            elements.append(_reader(element))
            parts.append(_memory(element, element.block))
        elif isinstance(element.block, Continuous) and any(p.modifier.stage == LIMIT for p in element.modifiers):
            rows = _rows(loop, element, element.block)
            elements.extend(_readers(element, rows))
            parts.append(_limited(element, rows))
        elif isinstance(element.block, Continuous):
            linear, own = _split(loop, element, element.block)
            elements.append(linear)
            parts.extend(own)
        else:
            elements.append(element)
    return Parted(replace(loop, elements=tuple(elements)), tuple(parts))


def _reader(element: Element) -> Element:
    """What stands in a memory's place: a wire that shows what enters it."""
    source = element.inputs[element.block.inputs[0]]
    return Element(f"{element.name}@argument", Gain(), {"input": source}, {"output": f"{element.name}@argument"})


def _memory(element: Element, block: Follower) -> NonlinearPart:
    memory, before, u, elapsed = (ca.SX.sym(name) for name in ("memory", "before", "u", "elapsed"))
    followed = ca.SX(block.follow(memory, u, elapsed))
    formula = ca.Function("memory", [memory, before, u, elapsed], [followed, followed])
    arguments, results = (f"{element.name}@argument",), tuple(element.outputs.values())
    return NonlinearPart(element.name, arguments, results, formula, block, 1)


@final
@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows (derivatives, then outputs) of one element as formulas of its states and of what it reads."""

    rows: tuple[ca.SX, ...]
    states: tuple[str, ...]
    read: Mapping[str, str]  # name of the variable -> "" for an input port of the block, else a signal
    variables: ca.SX

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.states, *self.read)


def _rows(loop: Loop, element: Element, block: Continuous) -> _Rows:
    ports = {port: f"{port}@port" for port in block.inputs}
    plain = replace(element, inputs={port: signal_expression(name) for port, name in ports.items()})
    alone = network(replace(loop, elements=(plain,)))
    read = {name: "" if name in ports.values() else name for name in alone.loop.externals}
    names = (*block.states, *read)
    variables = ca.SX.sym("variable", len(names))
    symbols = dict(zip(names, ca.vertsplit(variables) if names else [], strict=True))
    states = {(element.name, state): symbols[state] for state in block.states}
    externals: dict[str, Scalar] = {name: symbols[name] for name in read}
    leaves = Leaves(0.0, states, {}, {}, {}, externals)
    known = alone.signals(leaves)
    rates = alone.rates(leaves, known)
    derivatives = [rates[element.name, state] for state in block.states]
    outputs = [known[signal] for signal in element.outputs.values()]
    return _Rows(tuple(ca.SX(row) for row in (*derivatives, *outputs)), block.states, read, variables)


def _readers(element: Element, found: _Rows) -> list[Element]:
    """Wires that show what a block reads."""
    ports = {f"{port}@port": port for port in element.block.inputs}
    names = [f"{element.name}@{name}" for name in found.read]
    sources = [signal_expression(signal) if signal else element.inputs[ports[name]]
               for name, signal in found.read.items()]  # fmt: skip
    return [
        Element(name, Gain(), {"input": source}, {"output": name})
        for name, source in zip(names, sources, strict=True)
    ]


def _limited(element: Element, found: _Rows) -> NonlinearPart:
    """A whole block with states as one piece: what limits its own speed leaves no sine in its states.

    One classical Runge-Kutta step from what it read before to what it reads now.
    """
    n, count = len(found.states), len(found.names)
    x, before, now, elapsed = ca.SX.sym("x", n), ca.SX.sym("b", count - n), ca.SX.sym("u", count - n), ca.SX.sym("h")
    rows = ca.Function("rows", [found.variables], [ca.vertcat(*found.rows)])

    def rates(state: ca.SX, share: float) -> ca.SX:
        return rows(ca.vertcat(state, before + share * (now - before)))[:n]

    first = rates(x, 0.0)
    second = rates(x + elapsed / 2 * first, 0.5)
    third = rates(x + elapsed / 2 * second, 0.5)
    new = x + elapsed / 6 * (first + 2 * second + 2 * third + rates(x + elapsed * third, 1.0))
    formula = ca.Function("piece", [x, before, now, elapsed], [new, rows(ca.vertcat(new, now))[n:]])
    arguments = tuple(f"{element.name}@{name}" for name in found.read)
    return NonlinearPart(
        _name(element), arguments, tuple(element.outputs.values()), formula, None, n, _own_times(found)
    )


def _own_times(found: _Rows) -> tuple[float, float]:
    """The shortest and the longest time constant, s, at rest and where everything is large."""
    n = len(found.states)
    rates = ca.vertcat(*found.rows[:n])
    slopes = ca.Function("slopes", [found.variables], [ca.densify(ca.jacobian(rates, found.variables))])
    generator = np.random.default_rng(3)
    points = [np.zeros(len(found.names)), *(1e6 * generator.standard_normal((12, len(found.names))))]
    roots = [np.linalg.eigvals(np.asarray(slopes(point))[:, :n]) for point in points]
    decay = np.abs(roots[0].real)
    return 1.0 / float(max(np.abs(one).max() for one in roots)), 1.0 / float(decay[decay > 0].min(initial=np.inf))


def _split(loop: Loop, element: Element, block: Continuous) -> tuple[Element, tuple[NonlinearPart, ...]]:
    """The element's linear part, with an external input for each row that has more to it, and that more."""
    found = _rows(loop, element, block)
    whole = element.amplitude_dependent or block.amplitude_dependent
    every = list(range(len(found.names)))
    arguments = [every if whole else nonlinear_in(row, found.variables) for row in found.rows]
    if not any(arguments):
        return element, ()
    slopes = np.zeros((len(found.rows), len(found.names)))
    results: dict[str, ca.SX] = {}
    for index, (row, own) in enumerate(zip(found.rows, arguments, strict=True)):
        others = [k for k in every if k not in own]
        slopes[index, others] = _constant_slopes(row, found.variables)[others]
        rest = ca.substitute(row, found.variables, _masked(found.variables, own))
        if own or float(ca.evalf(ca.substitute(row, found.variables, ca.SX.zeros(len(every))))) != 0.0:
            results[f"{element.name}@nonlinear{index}"] = rest
    used = sorted({k for own in arguments for k in own})
    read = {f"{element.name}@{found.names[k]}": k for k in used}
    formula = ca.Function("piece", [found.variables[used]], [ca.densify(ca.vertcat(*results.values()))])
    own_block = block if whole and not block.states and not element.modifiers else None
    part = NonlinearPart(_name(element), tuple(read), tuple(results), formula, own_block)
    return _linear(element, found, slopes, (results, read)), (part,)


def _constant_slopes(row: ca.SX, variables: ca.SX) -> np.ndarray:
    """The row's slopes at zero: right for the variables in which it is linear."""
    at = ca.SX.zeros(variables.shape[0])
    return np.asarray(ca.evalf(ca.substitute(ca.densify(ca.jacobian(row, variables)), variables, at))).ravel()


def _masked(variables: ca.SX, kept: list[int]) -> ca.SX:
    return ca.vertcat(*[variables[k] if k in kept else 0.0 for k in range(variables.shape[0])])


def _name(element: Element) -> str:
    """What makes it nonlinear, as an engineer would say it: its effects, where they do, else the block."""
    effects = [p.name for p in element.modifiers if p.modifier.amplitude_dependent]
    return " and ".join(effects) or (element.modifiers[0].name if element.modifiers else element.name)


def _linear(
    element: Element, found: _Rows, slopes: np.ndarray, wired: tuple[Mapping[str, ca.SX], Mapping[str, int]]
) -> Element:
    """The element with slopes for formulas; it shows the arguments too, and what the piece gives is added."""
    results, read = wired
    n, count = len(found.states), len(found.names)
    added = np.zeros((len(found.rows), len(results)))
    for column, name in enumerate(results):
        added[int(name.rpartition("nonlinear")[2]), column] = 1.0
    shown = np.eye(count)[list(read.values())]
    rows = np.vstack([np.hstack([slopes, added]), np.hstack([shown, np.zeros((len(read), len(results)))])])
    ports = dict(zip((f"{port}@port" for port in element.block.inputs), element.block.inputs, strict=True))
    sources = [element.inputs[ports[name]] if not signal else signal_expression(signal)
               for name, signal in found.read.items()]  # fmt: skip
    sources += [signal_expression(name) for name in results]
    targets = [*element.outputs.values(), *read]
    block = _block(rows, n)
    inputs = dict(zip(block.inputs, sources, strict=True))
    outputs = dict(zip(block.outputs, targets, strict=True))
    return Element(element.name, block, inputs, outputs)


def _block(rows: np.ndarray, n: int) -> StateSpace | Gain:
    """[x'; y] = rows [x; u] as a block."""
    A, B, C, D = rows[:n, :n], rows[:n, n:], rows[n:, :n], rows[n:, n:]
    if n == 0:
        return Gain(gain=_tuples(D))
    return StateSpace(A=_tuples(A), B=_tuples(B), C=_tuples(C), D=_tuples(D))


def _tuples(matrix: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())
