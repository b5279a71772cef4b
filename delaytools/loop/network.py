"""Order and evaluation of a resolved loop: every signal as a formula of states, held values and inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import final

import casadi as ca

from delaytools.blocks.block import CASADI, Continuous, Follower, Sampled, Scalar, Transport
from delaytools.loop.loop import Element, Loop
from delaytools.loop.modifier import FRICTION, StateView
from delaytools.signals.trouble import DesignError

__all__ = ["Leaves", "Network", "network"]

Key = tuple[str, str]  # (element, state or port)


@final
@dataclass(frozen=True)
class Leaves:
    """What the signals are computed from, at one instant.

    t: time. states: (element, state). held: (element, port) of sampled blocks. delayed: element.
    memories: element of followers, as they were `elapsed` seconds ago. externals: signal.
    """

    t: Scalar
    states: Mapping[Key, Scalar]
    held: Mapping[Key, Scalar]
    delayed: Mapping[str, Scalar]
    memories: Mapping[str, Scalar]
    externals: Mapping[str, Scalar]
    elapsed: Scalar = 0.0


@final
@dataclass(frozen=True)
class Network:
    """A resolved loop with the order in which its outputs can be computed.

    order: (element, port), upstream first, sampled blocks taken as reading their inputs at the same instant.
    held_signals: signals that are constant between the ticks of sampled blocks (and their delayed copies).
    """

    loop: Loop
    order: tuple[Key, ...]
    held_signals: frozenset[str]
    elements: Mapping[str, Element] = field(default_factory=dict)

    def signals(self, leaves: Leaves) -> dict[str, Scalar]:
        """Every signal by name."""
        known: dict[str, Scalar] = dict(leaves.externals)
        for name, port in self.order:
            element = self.elements[name]
            known[element.outputs[port]] = self._output(element, port, leaves, known)
        return known

    def tick(
        self, leaves: Leaves, kept: Mapping[Key, Scalar], ticking: Mapping[str, Scalar]
    ) -> tuple[dict[Key, Scalar], dict[Key, Scalar]]:
        """New held outputs and new kept states after the sampled blocks named in `ticking` have updated.

        ticking: element -> 1 or a symbol that is 1 at a tick and 0 elsewhere. kept: (element, state) of sampled
        blocks. A block that reads another's output at the same instant sees the new value (upstream first).
        """
        held, new_kept = dict(leaves.held), dict(kept)
        known: dict[str, Scalar] = dict(leaves.externals)
        for name, port in self.order:
            element = self.elements[name]
            if name in ticking and isinstance(element.block, Sampled):
                states, outputs = self._update(element, leaves, kept, known)
                index = element.block.outputs.index(port)
                held[name, port] = _when(ticking[name], outputs[index], leaves.held[name, port])
                known[element.outputs[port]] = held[name, port]
                for state, new in zip(element.block.states, states, strict=True):
                    new_kept[name, state] = _when(ticking[name], new, kept[name, state])
            else:
                known[element.outputs[port]] = self._output(element, port, leaves, known)
        return held, new_kept

    def _update(
        self, element: Element, leaves: Leaves, kept: Mapping[Key, Scalar], known: Mapping[str, Scalar]
    ) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        block = element.block
        assert isinstance(block, Sampled)
        x = [kept[element.name, state] for state in block.states]
        u = [self._input_or_nothing(element, port, known) for port in block.inputs]
        return block.update(x, u, [leaves.held[element.name, port] for port in block.outputs])

    def _output(
        self,
        element: Element,
        port: str,
        leaves: Leaves,
        known: Mapping[str, Scalar],
    ) -> Scalar:
        match element.block:
            case Sampled():
                return leaves.held[element.name, port]
            case Transport():
                return leaves.delayed[element.name]
            case Follower() as block:
                u = self.input(element, block.inputs[0], known)
                return block.follow(leaves.memories[element.name], u, leaves.elapsed)
            case Continuous() as block:
                x = [leaves.states[element.name, state] for state in block.states]
                u = [self._input_or_nothing(element, name, known) for name in block.inputs]
                return block.output(leaves.t, x, u)[block.outputs.index(port)]
        raise AssertionError(f"{element.block!r} has no nature")

    def _input_or_nothing(self, element: Element, port: str, known: Mapping[str, Scalar]) -> Scalar:
        ready = all(n in known or n in self.loop.parameters for n in element.inputs[port].names)
        return self.input(element, port, known) if ready else ca.SX.nan(1)

    def input(self, element: Element, port: str, known: Mapping[str, Scalar]) -> Scalar:
        """The value at an input port, from the signals."""
        return element.inputs[port].evaluate({**self.loop.parameters, **known}, CASADI)

    def rates(self, leaves: Leaves, known: Mapping[str, Scalar]) -> dict[Key, Scalar]:
        """The derivative of every continuous state, with what acts on it."""
        found: dict[Key, Scalar] = {}
        for element in self.loop.elements:
            if isinstance(element.block, Continuous) and element.block.states:
                for state, rate in self._element_rates(element, leaves, known).items():
                    found[element.name, state] = rate
        return found

    def _element_rates(
        self, element: Element, leaves: Leaves, known: Mapping[str, Scalar]
    ) -> dict[str, Scalar]:
        block = element.block
        assert isinstance(block, Continuous)
        states = {state: leaves.states[element.name, state] for state in block.states}
        u = [self.input(element, port, known) for port in block.inputs]
        rates = dict(zip(block.states, block.rate(leaves.t, list(states.values()), u), strict=True))
        loads: dict[str, Scalar] = {}
        for placed in sorted(element.modifiers, key=lambda p: p.modifier.stage):
            modifier = placed.modifier
            if modifier.stage >= FRICTION:
                loads.setdefault(modifier.state, rates[modifier.state])
            load = loads.get(modifier.state, rates[modifier.state])
            sources = tuple(known[name] for name in placed.sources)
            position = position_of(block, modifier.state)
            here = states | {state: known[signal] for state, signal in placed.seen.items()}
            rates |= modifier.modify(StateView(leaves.t, here, rates, position, load, sources))
        return rates


def _when(flag: Scalar, new: Scalar, old: Scalar) -> Scalar:
    return new if isinstance(flag, int) and flag == 1 else ca.if_else(flag, new, old)


def position_of(block: Continuous, state: str) -> str:
    """The state whose derivative is just `state`, or "" where there is none."""
    symbols = [ca.SX.sym(name) for name in block.states]
    inputs = [ca.SX.sym(name) for name in block.inputs]
    target = symbols[block.states.index(state)]
    for name, rate in zip(block.states, block.rate(ca.SX.sym("t"), symbols, inputs), strict=True):
        if name != state and isinstance(rate, ca.SX) and ca.is_equal(rate, target, 1):
            return name
    return ""


def pushed_by(block: Continuous, name: str) -> str:
    """The one state to whose derivative an input is added, times a number, and which alone it reaches; else ""."""
    states = [ca.SX.sym(state) for state in block.states]
    inputs = [ca.SX.sym(port) for port in block.inputs]
    here, time = inputs[block.inputs.index(name)], ca.SX.sym("t")
    slopes = [ca.jacobian(ca.SX(rate), here) for rate in block.rate(time, states, inputs)]
    shown = [ca.jacobian(ca.SX(y), here) for y in block.output(time, states, inputs)]
    pushed = [state for state, slope in zip(block.states, slopes, strict=True) if not slope.is_zero()]
    alone = len(pushed) == 1 and all(y.is_zero() for y in shown)
    return pushed[0] if alone and all(slope.is_constant() for slope in slopes) else ""


def network(loop: Loop) -> Network:
    """The network of a resolved loop; raises DesignError for two writers of a signal or an algebraic loop."""
    elements = {element.name: element for element in loop.elements}
    writers: dict[str, Key] = {}
    for element in loop.elements:
        for port, signal in element.outputs.items():
            if signal in writers:
                raise DesignError(
                    "two writers of one signal",
                    where=signal,
                    found=f"{writers[signal][0]} and {element.name}",
                    advice="give each block an output signal of its own",
                )
            writers[signal] = (element.name, port)
    graph = {
        key: {writers[n] for n in names if n in writers}
        for element in loop.elements
        for key, names in _feedthrough(element, loop).items()
    }
    try:
        order = tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        path = " -> ".join(elements[name].outputs[port] for name, port in reversed(error.args[1]))
        raise DesignError(
            "an algebraic loop: no state and no delay between",
            found=path,
            advice="a real loop has dynamics or a delay somewhere on this way: put it in",
        ) from error
    return Network(loop, order, _held(loop, elements, order), elements)


def _feedthrough(element: Element, loop: Loop) -> dict[Key, set[str]]:
    """(element, port) -> signals that the output reads at the same instant."""
    names = {port: {n for n in x.names if n not in loop.parameters} for port, x in element.inputs.items()}
    block = element.block
    match block:
        case Transport():
            return {(element.name, port): set() for port in block.outputs}
        case Continuous():
            direct = _direct(block)
            return {
                (element.name, port): set().union(*(names[i] for i in direct[port])) for port in block.outputs
            }
        case Sampled():
            direct = _direct_sampled(block)
            return {
                (element.name, port): set().union(*(names[i] for i in direct[port])) for port in block.outputs
            }
    return {(element.name, port): set().union(*names.values()) for port in block.outputs}


def _dependence(
    outputs: Sequence[Scalar], ports: Sequence[str], inputs: list[ca.SX], names: Sequence[str]
) -> dict:
    found: dict[str, list[str]] = {}
    for port, expression in zip(ports, outputs, strict=True):
        formula = ca.SX(expression)
        depends = ca.which_depends(formula, ca.vertcat(*inputs), 1, False) if inputs else []
        found[port] = [name for name, does in zip(names, depends, strict=True) if does]
    return found


def _direct(block: Continuous) -> dict[str, list[str]]:
    x = [ca.SX.sym(name) for name in block.states]
    u = [ca.SX.sym(name) for name in block.inputs]
    return _dependence(block.output(ca.SX.sym("t"), x, u), block.outputs, u, block.inputs)


def _direct_sampled(block: Sampled) -> dict[str, list[str]]:
    x = [ca.SX.sym(name) for name in block.states]
    u = [ca.SX.sym(name) for name in block.inputs]
    held = [ca.SX.sym(name) for name in block.outputs]
    return _dependence(block.update(x, u, held)[1], block.outputs, u, block.inputs)


def _held(loop: Loop, elements: Mapping[str, Element], order: Sequence[Key]) -> frozenset[str]:
    """Signals that keep their value between events, followed through wires, gains, laws and delays."""
    held = {s for e in loop.sampled for s in e.outputs.values()} | {n for n in loop.random}
    while True:
        new = {
            element.outputs[port]
            for name, port in order
            if _keeps(element := elements[name], loop, held) and element.outputs[port] not in held
        }
        if not new:
            return frozenset(held)
        held |= new


def _keeps(element: Element, loop: Loop, held: set[str]) -> bool:
    names = {n for x in element.inputs.values() for n in x.names if n not in loop.parameters}
    match element.block:
        case Transport():
            first = element.inputs[element.block.inputs[0]]
            return {n for n in first.names if n not in loop.parameters} <= held
        case Follower() as block:
            memory, u, elapsed = (ca.SX.sym(name) for name in ("memory", "u", "elapsed"))
            return names <= held and not ca.depends_on(ca.SX(block.follow(memory, u, elapsed)), elapsed)
        case Continuous(states=(), inputs=inputs) as block if inputs and names <= held:
            t = ca.SX.sym("t")
            u = [ca.SX.sym(name) for name in inputs]
            return not any(ca.depends_on(ca.SX(y), t) for y in block.output(t, (), u))
    return False
