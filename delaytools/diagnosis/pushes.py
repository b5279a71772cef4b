"""What a force does to the exits where the motion that it acts on is measured: taken along the motion as it was.

A model that lacks the force may be far from where the bench was, an integrating one ever farther: along its own motion
the force would be another one. Along the measured motion it is the force that acted, and a linear segment answers to it
as to any input.
"""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import Continuous
from delaytools.diagnosis.added import Added, with_added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.noise_of import without_noise
from delaytools.diagnosis.views import View
from delaytools.loop.loop import Element, Loop
from delaytools.loop.network import Leaves, network
from delaytools.loop.port import Port, find_port
from delaytools.loop.values import resolve

__all__ = ["along_measured", "as_measured", "forces_on", "moves_as_measured"]

Array = NDArray[np.float64]
PROBES, CANCELLED = 4, 1e-6  # points at which a formula is asked what it depends on, and of its value: rounding


def as_measured(view: View, exit: str, log: int) -> Array:
    """(n,): an exit as measured, without the noise that no model explains."""
    case = view.case
    rows = case.measured[log][:, case.exits.index(exit)]
    return without_noise(rows, view.signals[log][exit], exit in case.records[log].held)


def moves_as_measured(loop: Loop, exits: tuple[str, ...], port: Port) -> bool:
    """Whether the state on whose derivative a port acts is measured."""
    return port.kind == "derivative" and port.name in _shown(loop, exits, port.element)


def _shown(loop: Loop, exits: tuple[str, ...], name: str) -> dict[str, str]:
    """State of a block -> the exit that is just this state."""
    element = resolve(Loop((loop[name],), loop.parameters, loop.units, loop.frame)).elements[0]
    block = element.block
    if not isinstance(block, Continuous):
        return {}
    x = [ca.SX.sym(state) for state in block.states]
    u = [ca.SX.sym(entry) for entry in block.inputs]
    found = {}
    for port, formula in zip(block.outputs, block.output(ca.SX.sym("t"), x, u), strict=True):
        for state, symbol in zip(block.states, x, strict=True):
            if element.outputs[port] in exits and isinstance(formula, ca.SX) and ca.is_equal(formula, symbol, 1):
                found[state] = element.outputs[port]
    return found


def forces_on(view: View, one: Added) -> tuple[Array, ...] | None:
    """Per log (n,): what an effect adds to the derivative at its port along the measured motion.

    None where it depends on a state that is not measured.
    """
    plain = view.loop
    port = find_port(plain, one.at)
    shown = _shown(plain, view.case.exits, port.element)
    formula, names = _added_rate(plain[port.element], with_added(plain, (one,))[port.element], plain, port)
    symbols = ca.symvar(formula)
    if not _states(symbols) <= set(shown):
        return None
    evaluate = ca.Function("added", symbols, [formula])
    found = []
    for log, record in enumerate(view.case.records):
        known = {"t": record.time - record.time[0]}
        known |= {f"state:{state}": as_measured(view, exit, log) for state, exit in shown.items()}
        columns = []
        for symbol in symbols:
            name = symbol.name()
            columns.append(known[name] if name in known else _signal(view, names[name], log))
        rows = evaluate.map(len(record))(*(ca.DM(c).T for c in columns)) if symbols else evaluate()["o0"]
        found.append(np.broadcast_to(np.asarray(rows, dtype=float).ravel(), (len(record),)))
    return tuple(found)


def along_measured(case: Case, added: tuple[Added, ...], one: Added) -> Added | None:
    """The effect acting along the measured motion; None where that is not measured, or says nothing of it.

    A force that drives its segment away from where it was makes any run of the model alone run away, the true one, too.
    added: what acts beside it.
    """
    loop = with_added(case.segment.loop, added)
    port = find_port(loop, one.at)
    if port.kind != "derivative" or "smoothing" in one.values:
        return None
    shown = _shown(loop, case.exits, port.element)
    host = with_added(loop, (one,))[port.element]
    needed = _states(ca.symvar(_added_rate(loop[port.element], host, loop, port)[0]))
    return replace(one, along={state: shown[state] for state in needed}) if needed and needed <= set(shown) else None


def _states(symbols: Sequence[ca.SX]) -> set[str]:
    """Names of the states among the symbols of a rate."""
    return {s.name().removeprefix("state:") for s in symbols if s.name().startswith("state:")}


def _signal(view: View, name: str, log: int) -> Array:
    exits = view.case.exits
    return as_measured(view, name, log) if name in exits else view.signals[log][name]


def _added_rate(before: Element, after: Element, loop: Loop, port: Port) -> tuple[ca.SX, dict[str, str]]:
    """The derivative with the effect minus that without, and the signal of every symbol in it that is one."""
    names = {n for e in (before, after) for x in e.inputs.values() for n in x.names if n not in loop.parameters}
    names |= {n for placed in after.modifiers for n in placed.read}
    signals = {n: ca.SX.sym(f"signal:{n}") for n in sorted(names)}
    states = {(before.name, s): ca.SX.sym(f"state:{s}") for s in before.block.states}  # type: ignore[attr-defined]
    leaves = Leaves(ca.SX.sym("t"), states, {}, {}, {}, signals)
    rates = []
    for element in (after, before):
        net = network(resolve(Loop((element,), loop.parameters, loop.units, loop.frame)))
        rates.append(ca.SX(net.rates(leaves, signals)[element.name, port.name]))
    return _of_what_counts(rates[0] - rates[1]), {symbol.name(): name for name, symbol in signals.items()}


def _of_what_counts(formula: ca.SX) -> ca.SX:
    """The formula without the symbols that cancel in it: what a block does without the effect stands on both sides."""
    symbols = ca.symvar(formula)
    evaluate = ca.Function("difference", symbols, [formula])
    draw = np.random.default_rng(0).uniform(0.5, 1.5, (PROBES, len(symbols) + 1))
    for place, symbol in enumerate(symbols):
        moved = draw[:, :-1].copy()
        moved[:, place] = draw[:, -1]
        change = [float(evaluate(*a) - evaluate(*b)) for a, b in zip(draw[:, :-1], moved, strict=True)]
        if np.abs(change).max() <= CANCELLED * max(abs(float(evaluate(*a))) for a in moved):
            formula = ca.substitute(formula, symbol, 0)
    return ca.simplify(formula)
