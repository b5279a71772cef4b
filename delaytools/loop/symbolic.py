"""L(jω) with values left as symbols: exact delays, in real arithmetic, so that it can be differentiated."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import Sampled, Scalar
from delaytools.loop.linearise import (
    Formulas,
    formulas,
    operating_point,
    sampler_formulas,
    transport_seconds,
)
from delaytools.loop.loop import Loop
from delaytools.loop.values import value_paths
from delaytools.signals.trouble import AnalysisError, DesignError

__all__ = ["nominal_values", "symbolic_response"]

Pair = tuple[Scalar, Scalar]  # real and imaginary part


def nominal_values(loop: Loop, paths: Sequence[str]) -> dict[str, float]:
    """The numbers that stand at the paths now, also of blocks that are neutral; raises DesignError for no path."""
    found = value_paths(loop)
    for path in paths:
        if path not in found:
            raise DesignError("no such value in the design", found=repr(path), known=sorted(found))
    return {path: found[path] for path in paths}


def symbolic_response(loop: Loop, input: str, output: str, *, free: Sequence[str]) -> ca.Function:
    """(omega, p) -> (re, im) of G(jω) from an external input to a signal.

    omega > 0 in rad/s; p (len(free),): the values at the paths `free`, in their order; delays may be among them.
    Delays are exact; a sampled block is C(e^{jωT}), with (1 - e^{-jωT})/(jωT) where a continuous block reads it:
    the same rule as `continuous_approximation`. The complex system of n unknowns is solved as a real one of 2n.
    Raises DesignError for an unknown path or signal, AnalysisError where the loop's rest moves with p.
    """
    p = [ca.SX.sym(path) for path in free]
    lines = formulas(loop, [output], free=dict(zip(free, p, strict=True)))
    if input not in lines.symbols.externals:
        raise DesignError("not an external input", found=repr(input), known=lines.symbols.externals)
    nominal = [] if _is_linear(lines) else list(nominal_values(loop, free).values())
    matrix = _matrix(lines, ca.vertcat(*p), nominal)
    omega = ca.SX.sym("omega")
    real, imaginary = _complex_matrix(lines, _Wiring(lines, matrix, input), omega)
    parts = ca.Function("parts", [omega, ca.vertcat(*p)], [real, imaginary])
    return _solved(parts, len(free))


def _is_linear(lines: Formulas) -> bool:
    everything = lines.symbols.all
    return everything.shape[0] == 0 or ca.is_linear(lines.rows, everything)


def _matrix(lines: Formulas, p: ca.SX, nominal: list[float]) -> ca.SX:
    """M(p), [x'; z; q; y] = M [x; v; w; e], about the loop's rest at the nominal values."""
    everything = lines.symbols.all
    jacobian = ca.jacobian(lines.rows, everything)
    if not nominal:
        return ca.sparsify(ca.substitute(jacobian, everything, ca.SX.zeros(everything.shape[0])))
    at_nominal = ca.substitute(lines.rows, p, ca.SX(ca.DM(nominal)))
    point = operating_point(Formulas(lines.net, lines.symbols, at_nominal, lines.outputs, lines.without))
    n = lines.symbols.x.shape[0]
    drift = ca.substitute(ca.jacobian(lines.rows[:n], p), everything, ca.SX(ca.DM(point)))
    moved = np.asarray(ca.evalf(ca.substitute(drift, p, ca.SX(ca.DM(nominal)))))
    if np.max(np.abs(moved), initial=0.0) > 1e-9:
        raise AnalysisError(
            "the loop's rest moves with a free value, so that its linear form is not known beforehand",
            found=f"a rate of {np.max(np.abs(moved)):.3g} per unit of the value",
            advice="free another value, or take out what holds the loop off its rest",
        )
    return ca.sparsify(ca.substitute(jacobian, everything, ca.SX(ca.DM(point))))


@final
@dataclass(frozen=True)
class _Wiring:
    """M's parts by name, and which transports carry held signals only (read raw by sampled blocks)."""

    lines: Formulas
    matrix: ca.SX
    input: str

    def part(self, row: str, column: str) -> ca.SX:
        """The part of M from x, v, w or e (only the input) to x (that is x'), z, q or y."""
        s = self.lines.symbols
        inputs = sum(len(e.block.inputs) for e in self.lines.net.loop.sampled)
        rows = {"x": len(s.states), "z": len(s.transports), "q": inputs, "y": 1}
        columns = {"x": len(s.states), "v": len(s.held), "w": len(s.transports), "e": len(s.externals)}
        found = self.matrix[_place(rows, row), _place(columns, column)]
        return found if column != "e" else found[:, s.externals.index(self.input)]

    def purely_held(self) -> list[int]:
        """The transports whose entry is made of held signals and of other such transports."""
        if not self.lines.net.loop.sampled:
            return []
        mixed = np.asarray(np.hstack([_pattern(self.part("z", "x")), _pattern(self.part("z", "e"))]).any(axis=1))
        chained = _pattern(self.part("z", "w"))
        for _ in range(len(mixed)):
            mixed = mixed | (chained & mixed[None, :]).any(axis=1)
        return [int(i) for i in np.flatnonzero(~mixed)]


def _place(sizes: dict[str, int], name: str) -> slice:
    names = list(sizes)
    start = sum(sizes[n] for n in names[: names.index(name)])
    return slice(start, start + sizes[name])


def _pattern(matrix: ca.SX) -> NDArray[np.bool_]:
    return np.asarray(np.asarray(ca.DM(matrix.sparsity(), 1.0)).reshape(matrix.shape) != 0)


def _samplers(lines: Formulas) -> tuple[ca.SX, ...]:
    """F, G, H, D of all sampled blocks, block-diagonally."""
    blocks = [e.block for e in lines.net.loop.sampled]
    every = [sampler_formulas(block) for block in blocks if isinstance(block, Sampled)]
    if not every:
        return (ca.SX(0, 0),) * 4
    return tuple(ca.sparsify(ca.diagcat(*parts)) for parts in zip(*every, strict=True))


def _rows(wiring: _Wiring, pure: list[int], plain: list[int]) -> list[tuple[ca.SX, bool]]:
    """(rows over [x, v, xi, raw, held, plain, e], whether they read v through its hold), group after group."""
    F, G, H, D = _samplers(wiring.lines)
    nxi, npure = F.shape[0], len(pure)

    def read(row: str, through_hold: bool, only: list[int] | None = None) -> ca.SX:
        w = wiring.part(row, "w")
        count = w.shape[0]
        empty = ca.SX(count, npure)
        carried = [empty, w[:, pure]] if through_hold else [w[:, pure], empty]
        parts = [wiring.part(row, "x"), wiring.part(row, "v"), ca.SX(count, nxi), *carried, w[:, plain]]
        whole = ca.horzcat(*parts, wiring.part(row, "e"))
        return whole if only is None else whole[only, :]

    q = read("q", False)
    y = wiring.part("y", "x").nnz() + wiring.part("y", "w").nnz() + wiring.part("y", "e").nnz()

    def through_states(straight: ca.SX, by_state: ca.SX) -> ca.SX:
        padding = [ca.SX(straight.shape[0], size) for size in _padding(q.shape[1], by_state.shape[1], wiring)]
        return ca.mtimes(straight, q) + ca.horzcat(padding[0], by_state, padding[1])

    return [
        (read("x", True), True), (through_states(D, H), False), (through_states(G, F), False),
        (read("z", False, pure), False), (read("z", True, pure), True), (read("z", True, plain), True),
        (read("y", y > 0), y > 0),
    ]  # fmt: skip


def _padding(columns: int, states: int, wiring: _Wiring) -> tuple[int, int]:
    before = len(wiring.lines.symbols.states) + len(wiring.lines.symbols.held)
    return before, columns - before - states


def _complex_matrix(lines: Formulas, wiring: _Wiring, omega: ca.SX) -> Pair:
    """[[T, -b], [-c, -d]] with T X = b e and y = c X + d e, for X = [x; v; xi; raw; held; plain]."""
    pure = wiring.purely_held()
    plain = [i for i in range(len(lines.symbols.transports)) if i not in pure]
    groups = _rows(wiring, pure, plain)
    lags = _lags(lines, omega, pure, plain)
    holds = _holds(lines, omega)
    n, first = groups[0][0].shape[1] - 1, len(lines.symbols.states)
    real, imaginary = ca.SX(n + 1, n + 1), ca.SX(n + 1, n + 1)
    row = 0
    for (matrix, held), turns in zip(groups, [*lags, [(1.0, 0.0)]], strict=True):
        for i in range(matrix.shape[0]):
            for j in range(n + 1):
                if matrix[i, j].nnz():
                    hold = holds[j - first] if held and 0 <= j - first < len(holds) else (1.0, 0.0)
                    a, b = _times(turns[i], hold)
                    real[row, j], imaginary[row, j] = -a * matrix[i, j], -b * matrix[i, j]
            row += 1
    for i in range(n):
        real[i, i] = real[i, i] + (0 if i < first else 1)
        imaginary[i, i] = imaginary[i, i] + (omega if i < first else 0)
    return real, imaginary


def _lags(lines: Formulas, omega: ca.SX, pure: list[int], plain: list[int]) -> list[list[Pair]]:
    """The factor of every row but y's: 1 for x and v, e^{-jωT} for sampled states, e^{-jωτ} for transports."""
    elements = [lines.net.elements[name] for name in lines.symbols.transports]
    seconds = [transport_seconds(element) for element in elements]
    steps = [e.block.period for e in lines.net.loop.sampled if isinstance(e.block, Sampled) for _ in e.block.states]
    one: Pair = (1.0, 0.0)
    late = [_turn(omega * tau) for tau in seconds]
    return [
        [one] * len(lines.symbols.states), [one] * len(lines.symbols.held), [_turn(omega * T) for T in steps],
        [late[i] for i in pure], [late[i] for i in pure], [late[i] for i in plain],
    ]  # fmt: skip


def _holds(lines: Formulas, omega: ca.SX) -> list[Pair]:
    """(1 - e^{-jωT})/(jωT) = e^{-jωT/2} sin(ωT/2)/(ωT/2) for every held output."""
    periods = [e.block.period for e in lines.net.loop.sampled if isinstance(e.block, Sampled) for _ in e.block.outputs]
    found = []
    for period in periods:
        half = omega * period / 2
        size = ca.sin(half) / half
        found.append((size * ca.cos(half), -size * ca.sin(half)))
    return found


def _turn(angle: ca.SX) -> Pair:
    return ca.cos(angle), -ca.sin(angle)


def _times(first: Pair, second: Pair) -> Pair:
    return first[0] * second[0] - first[1] * second[1], first[0] * second[1] + first[1] * second[0]


def _solved(parts: ca.Function, count: int) -> ca.Function:
    """(omega, p) -> (re, im) of d + c T⁻¹ b, from the parts of [[T, -b], [-c, -d]]."""
    omega, p = ca.MX.sym("omega"), ca.MX.sym("p", count)
    real, imaginary = parts(omega, p)
    n = real.shape[0] - 1
    T = ca.blockcat([[real[:n, :n], -imaginary[:n, :n]], [imaginary[:n, :n], real[:n, :n]]])
    b = ca.densify(ca.vertcat(-real[:n, n], -imaginary[:n, n]))
    c, g = (-ca.densify(part[n, :n]) for part in (real, imaginary))
    d = (-ca.densify(part[n, n]) for part in (real, imaginary))
    if n == 0:
        return ca.Function("response", [omega, p], list(d), ["omega", "p"], ["re", "im"])
    X = ca.solve(T, b, "qr")
    rows = (ca.horzcat(c, -g), ca.horzcat(g, c))
    answer = [ca.mtimes(row, X) + end for row, end in zip(rows, d, strict=True)]
    return ca.Function("response", [omega, p], answer, ["omega", "p"], ["re", "im"])
