"""Loop → linear system: the blocks' own formulas, differentiated at an operating point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from delaytools.blocks.block import Continuous, Sampled, Scalar, Transport
from delaytools.linear.sampled_system import SampledSystem, Sampler
from delaytools.loop.edit import wire
from delaytools.loop.linearity import is_linear
from delaytools.loop.loop import Element, Loop
from delaytools.loop.network import Key, Leaves, Network, network
from delaytools.loop.values import resolve
from delaytools.signals.trouble import AnalysisError, DesignError

__all__ = [
    "Formulas",
    "Linearised",
    "formulas",
    "linearise",
    "operating_point",
    "rest",
    "sampler_formulas",
    "transport_seconds",
]


@final
@dataclass(frozen=True)
class Linearised:
    """A loop's linear system, and what it stands on.

    system: [x'; z; q; y] = M [x; v; w; e] with its delays and samplers. without: effects taken at their neutral
    value, `TYPE@PORT`. operating_point: state -> value where formulas were differentiated; empty where they are linear.
    """

    system: SampledSystem
    without: tuple[str, ...]
    operating_point: Mapping[str, float]


@final
@dataclass(frozen=True)
class _Symbols:
    x: ca.SX
    v: ca.SX
    w: ca.SX
    e: ca.SX
    states: tuple[Key, ...]
    held: tuple[Key, ...]
    transports: tuple[str, ...]
    externals: tuple[str, ...]

    @property
    def all(self) -> ca.SX:
        return ca.vertcat(self.x, self.v, self.w, self.e)


@final
@dataclass(frozen=True)
class Formulas:
    """A loop's own lines as formulas: `rows` [x'; z; q; y] of `symbols` (x, v, w, e).

    x: states, v: held outputs of sampled blocks, w: outputs of transports, e: external inputs, z: inputs of
    transports, q: inputs of sampled blocks, y: the chosen signals. without: effects taken at their neutral value.
    """

    net: Network
    symbols: _Symbols
    rows: ca.SX
    outputs: tuple[str, ...]
    without: tuple[str, ...]


def formulas(
    loop: Loop, outputs: Sequence[str] | None = None, *, free: Mapping[str, Scalar] | None = None
) -> Formulas:
    """The formulas from external inputs to signals (default: all), with symbols at the paths in `free`."""
    quiet, without = without_amplitude_effects(resolve(loop, free))
    net = network(quiet)
    symbols = _symbols(net)
    leaves = _leaves(symbols, quiet.moment)
    known = net.signals(leaves)
    chosen = tuple(outputs if outputs is not None else quiet.signals)
    for name in chosen:
        if name not in known:
            raise DesignError("unknown signal", found=repr(name), known=quiet.signals)
    return Formulas(net, symbols, _rows(net, symbols, leaves, known, chosen), chosen, without)


def linearise(
    loop: Loop, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
) -> Linearised:
    """The linear system from external inputs to signals (default: all of each).

    Amplitude-dependent effects are taken at their neutral value; other nonlinearities are differentiated where the
    loop rests with every external input at zero. Raises AnalysisError where no such rest is found.
    """
    lines = formulas(loop, outputs)
    net, symbols = lines.net, lines.symbols
    point = operating_point(lines)
    kept = tuple(inputs if inputs is not None else symbols.externals)
    matrix = _matrix(symbols, lines.rows, point, kept)
    names = tuple(f"{element}.{state}" for element, state in symbols.states)
    delays = tuple(float(transport_seconds(net.elements[name])) for name in symbols.transports)
    samplers = tuple(_sampler(e) for e in net.loop.sampled)
    system = SampledSystem(matrix, len(names), delays, samplers, kept, lines.outputs, names)
    where = dict(zip(names, point[: len(names)].tolist(), strict=True)) if np.any(point) else {}
    return Linearised(system, lines.without, where)


def without_amplitude_effects(loop: Loop) -> tuple[Loop, tuple[str, ...]]:
    """The resolved loop with amplitude-dependent effects at their neutral value, and their names.

    Varying delays are kept at their mean, and named too.
    """
    names: list[str] = []
    elements = []
    for element in loop.elements:
        if element.amplitude_dependent or element.block.amplitude_dependent:
            names.append(element.name)
            element = wire(element)
        elif isinstance(element.block, Transport) and element.block.varies:
            names.append(element.name)
        kept = tuple(p for p in element.modifiers if not p.modifier.amplitude_dependent)
        names.extend(p.name for p in element.modifiers if p not in kept)
        elements.append(replace(element, modifiers=kept))
    return replace(loop, elements=tuple(elements)), tuple(names)


def _symbols(net: Network) -> _Symbols:
    loop = net.loop
    states = tuple(
        (e.name, s) for e in loop.continuous if isinstance(e.block, Continuous) for s in e.block.states
    )
    held = tuple((e.name, port) for e in loop.sampled for port in e.block.outputs)
    transports = tuple(e.name for e in loop.transports)
    sizes = (len(states), len(held), len(transports), len(loop.externals))
    x, v, w, e = (ca.SX.sym(name, size) for name, size in zip("xvwe", sizes, strict=True))
    return _Symbols(x, v, w, e, states, held, transports, loop.externals)


def _leaves(symbols: _Symbols, moment: float) -> Leaves:
    return Leaves(
        t=moment,
        states={key: symbols.x[i] for i, key in enumerate(symbols.states)},
        held={key: symbols.v[i] for i, key in enumerate(symbols.held)},
        delayed={name: symbols.w[i] for i, name in enumerate(symbols.transports)},
        memories={},
        externals={name: symbols.e[i] for i, name in enumerate(symbols.externals)},
    )


def _rows(
    net: Network, symbols: _Symbols, leaves: Leaves, known: Mapping[str, Any], outputs: Sequence[str]
) -> ca.SX:
    rates = net.rates(leaves, known)
    rows = [rates[key] for key in symbols.states]
    for name in symbols.transports:
        element = net.elements[name]
        rows.append(net.input(element, element.block.inputs[0], known))
    for element in net.loop.sampled:
        rows.extend(net.input(element, port, known) for port in element.block.inputs)
    rows.extend(known[name] for name in outputs)
    return ca.vertcat(*[ca.SX(row) for row in rows])


def operating_point(lines: Formulas) -> NDArray[np.float64]:
    """Values of (x, v, w, e) where rates vanish, delays and samplers are at rest and externals are 0.

    Zero where the formulas are linear; elsewhere they may hold no free symbol. Raises AnalysisError where there is
    no rest.
    """
    everything = lines.symbols.all
    if everything.shape[0] == 0 or is_linear(lines.rows, everything):
        return np.zeros(everything.shape[0])
    return rest(lines)


def rest(lines: Formulas, wanted: Mapping[str, float] | None = None, by: Sequence[str] = ()) -> NDArray[np.float64]:
    """Values of (x, v, w, e) where the loop is at rest; externals are 0, but those in `by`.

    wanted: values of outputs of the lines that these bring about, one for each. Raises AnalysisError where there is no
    rest.
    """
    net, symbols, rows = lines.net, lines.symbols, lines.rows
    n, nv, nw = symbols.x.shape[0], symbols.v.shape[0], symbols.w.shape[0]
    sampled = rows[n + nw : n + nw + sum(len(e.block.inputs) for e in net.loop.sampled)]
    outputs = rows[rows.shape[0] - len(lines.outputs) :]
    asked = [outputs[lines.outputs.index(name)] - value for name, value in (wanted or {}).items()]
    places = [symbols.externals.index(name) for name in by]
    sought = ca.vertcat(ca.SX(0, 1), *(symbols.e[k] for k in places))
    e = ca.vertcat(ca.SX(0, 1), *(symbols.e[k] if k in places else 0.0 for k in range(symbols.e.shape[0])))
    still = ca.vertcat(rows[:n], rows[n : n + nw] - symbols.w, _sampled_rest(net, symbols, sampled), *asked)
    free = ca.vertcat(symbols.x, symbols.v, symbols.w, sought)
    still = ca.substitute(still, symbols.e, e)
    residual = ca.Function("rest", [free], [still, ca.densify(ca.jacobian(still, free))])
    begin = np.zeros(n + nv + nw + len(places))
    begin[:n] = [float(s) for e in net.loop.continuous for s in e.block.initial_state]
    found = least_squares(
        lambda u: np.asarray(residual(u)[0]).ravel(),
        begin,
        jac=lambda u: np.asarray(residual(u)[1]),
        xtol=1e-15,
        ftol=1e-15,
    )
    if not np.all(np.isfinite(found.x)) or np.max(np.abs(found.fun), initial=0.0) > 1e-8 * (
        1 + np.max(np.abs(found.x))
    ):
        raise AnalysisError(
            "no operating point: the loop comes to no rest",
            found=f"largest remaining rate {np.max(np.abs(found.fun)):.3g}",
            advice="give initial states near an equilibrium, or inputs that allow one",
        )
    externals = np.zeros(symbols.e.shape[0])
    externals[places] = found.x[n + nv + nw :]
    return np.append(found.x[: n + nv + nw], externals)


def _sampled_rest(net: Network, symbols: _Symbols, q: ca.SX) -> ca.SX:
    """v - (steady output of each sampled block for the input q)."""
    rests, at = [], 0
    for element in net.loop.sampled:
        sampler = _sampler(element)
        count = len(element.block.inputs)
        rests.append(ca.mtimes(ca.DM(sampler.steady_gain), q[at : at + count]))
        at += count
    return symbols.v - ca.vertcat(*rests) if rests else ca.SX(0, 1)


def _matrix(
    symbols: _Symbols, rows: ca.SX, point: NDArray[np.float64], inputs: Sequence[str]
) -> NDArray[np.float64]:
    everything = symbols.all
    jacobian = ca.Function("jacobian", [everything], [ca.densify(ca.jacobian(rows, everything))])
    values = np.asarray(jacobian(point)).reshape(rows.shape[0], everything.shape[0])
    own = everything.shape[0] - len(symbols.externals)
    for name in inputs:
        if name not in symbols.externals:
            raise DesignError("not an external input", found=repr(name), known=symbols.externals)
    columns = [*range(own), *(own + symbols.externals.index(name) for name in inputs)]
    return values[:, columns]


def transport_seconds(element: Element) -> Scalar:
    """The delay of a transport, s; the mean of one that varies."""
    block = element.block
    assert isinstance(block, Transport)
    return getattr(block, "mean", 0.0) if block.varies else block.seconds(0.0, [])


def sampler_formulas(block: Sampled) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """F, G, H, D of the linear part of a sampled block at rest: x⁺ = F x + G q, v = H x + D q."""
    x, u = ca.SX.sym("x", len(block.states)), ca.SX.sym("u", len(block.inputs))
    held = ca.SX.zeros(len(block.outputs), 1)
    new, out = block.update(ca.vertsplit(x) if block.states else [], ca.vertsplit(u), ca.vertsplit(held))
    both = [
        ca.vertcat(*[ca.SX(n) for n in new]) if new else ca.SX(0, 1),
        ca.vertcat(*[ca.SX(n) for n in out]),
    ]
    at = ca.vertcat(x, u)
    F, G, H, D = (
        ca.substitute(ca.densify(ca.jacobian(f, s)), at, ca.SX.zeros(at.shape[0])) for f in both for s in (x, u)
    )
    return F, G, H, D


def _sampler(element: Element) -> Sampler:
    """The sampler of an element without free values."""
    block = element.block
    assert isinstance(block, Sampled)
    F, G, H, D = (np.asarray(ca.evalf(part)).reshape(part.shape) for part in sampler_formulas(block))
    return Sampler(float(block.period), F, G, H, D)
