"""Transports pushed to the front: every signal as delay-free states driven by held signals of known lag."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from delaytools.linear.matrices import RealMatrix
from delaytools.linear.sampled_system import SampledSystem
from delaytools.signals.trouble import AnalysisError

__all__ = ["CONTINUOUS_CYCLE", "TOO_MANY_PATHS", "Expansion", "delay_free_blocks", "expanded"]

CONTINUOUS_CYCLE = "a delay lies inside a purely continuous feedback cycle"
TOO_MANY_PATHS = "the delays open more than 1000 delayed copies of states"
MOST_COPIES = 1000
LAG_DIGITS = 15  # lags of one path summed in another order differ by rounding only

Term = tuple[str, int, float]  # ("x" or "h", index, lag in s)
Terms = dict[Term, float]


@final
@dataclass(frozen=True, eq=False)
class Blocks:
    """The wiring without its zero delays: rows x', z, q, y over columns x, h (held signals), w."""

    x: tuple[RealMatrix, RealMatrix, RealMatrix]
    z: tuple[RealMatrix, RealMatrix, RealMatrix]
    q: tuple[RealMatrix, RealMatrix, RealMatrix]
    y: tuple[RealMatrix, RealMatrix, RealMatrix]
    delays: tuple[float, ...]


@final
@dataclass(frozen=True, eq=False)
class Expansion:
    """X' = A X + B u, q = Cq X + Dq u, y = Cy X + Dy u; X_i(t) = x_j(t - lag), u_i(t) = h_j(t - lag).

    copies, held: the pairs (j, lag in s) that X and u list; h are the held signals (v, then held inputs).
    """

    copies: tuple[tuple[int, float], ...]
    held: tuple[tuple[int, float], ...]
    A: RealMatrix
    B: RealMatrix
    Cq: RealMatrix
    Dq: RealMatrix
    Cy: RealMatrix
    Dy: RealMatrix


def delay_free_blocks(sampled: SampledSystem, held_inputs: Sequence[int]) -> Blocks:
    """The wiring with zero delays closed algebraically; only `held_inputs` of e are kept.

    Raises AnalysisError where zero delays close an algebraic loop.
    """
    zero = np.array([delay == 0.0 for delay in sampled.delays], dtype=bool)
    M = _without(np.array(sampled.M), sampled, zero)
    w = np.arange(M.shape[1])[sampled.columns("w")][~zero]
    e = np.arange(M.shape[1])[sampled.columns("e")][list(held_inputs)]
    x, v = (np.arange(M.shape[1])[sampled.columns(name)] for name in ("x", "v"))
    columns = (x, np.concatenate([v, e]).astype(int), w)
    rows = {name: np.arange(M.shape[0])[sampled.rows(name)] for name in ("x", "z", "q", "y")}
    rows["z"] = rows["z"][~zero]
    parts = {name: tuple(M[np.ix_(row, column)] for column in columns) for name, row in rows.items()}
    delays = tuple(delay for delay in sampled.delays if delay != 0.0)
    return Blocks(parts["x"], parts["z"], parts["q"], parts["y"], delays)


def _without(M: RealMatrix, sampled: SampledSystem, zero: np.ndarray) -> RealMatrix:
    """M with w_i = z_i put in for the zero delays: M + M_w (I - D)⁻¹ M_z."""
    if not zero.any():
        return M
    w = np.arange(M.shape[1])[sampled.columns("w")][zero]
    z = np.arange(M.shape[0])[sampled.rows("z")][zero]
    direct = np.eye(len(z)) - M[np.ix_(z, w)]
    if np.linalg.cond(direct) > 1e12:
        raise AnalysisError("zero delays close an algebraic loop", advice="break it by dynamics or a delay")
    return M + M[:, w] @ np.linalg.solve(direct, M[z, :])


def expanded(blocks: Blocks) -> Expansion | str:
    """The delayed copies that the samplers and outputs need; words where the delays do not allow it.

    z_i(t) = Σ c x_j(t - ρ) + Σ d h_k(t - ρ) has finitely many terms when no delay closes a continuous cycle,
    and linear time-invariant parts commute with delay, so that x_j(t - ρ) has the equation of x_j, ρ later.
    Each state has at least one copy, so that no hidden mode is lost.
    """
    if _delay_in_cycle(blocks):
        return CONTINUOUS_CYCLE
    transports = _transport_terms(blocks)
    x, q, y = (_row_terms(part, blocks.delays, transports) for part in (blocks.x, blocks.q, blocks.y))
    copies = _needed(x, [*q, *y])
    if len(copies) > MOST_COPIES:
        return TOO_MANY_PATHS
    rates = [_shifted(x[j], lag) for j, lag in copies]
    return _assembled(copies, rates, q, y)


def _delay_in_cycle(blocks: Blocks) -> bool:
    """Whether some reader of w_i stands in one cycle with z_i."""
    (A, _, Bw), (Cz, _, Dzw) = blocks.x, blocks.z
    reads = np.block([[A, Bw], [Cz, Dzw]]) != 0
    reaches = reads.astype(np.float32) + np.eye(len(reads), dtype=np.float32)
    for _ in range(len(reads).bit_length()):
        reaches = np.minimum(reaches @ reaches, 1)
    n = A.shape[0]
    readers, transports = np.nonzero(reads[:, n:])
    return bool(np.any(reaches[n + transports, readers] > 0))


def _transport_terms(blocks: Blocks) -> list[Terms]:
    """z_i as terms in x and h, for each i (the graph z to z has no cycle)."""
    known: dict[int, Terms] = {}

    def terms(i: int) -> Terms:
        if i not in known:
            Cx, Ch, Cw = (part[i] for part in blocks.z)
            known[i] = _collected(Cx, Ch, [(c, blocks.delays[k], terms(k)) for k, c in _entries(Cw)])
        return known[i]

    return [terms(i) for i in range(len(blocks.delays))]


def _row_terms(
    part: tuple[RealMatrix, RealMatrix, RealMatrix], delays: Sequence[float], transports: Sequence[Terms]
) -> list[Terms]:
    return [
        _collected(Cx, Ch, [(c, delays[k], transports[k]) for k, c in _entries(Cw)])
        for Cx, Ch, Cw in zip(*part, strict=True)
    ]


def _entries(row: np.ndarray) -> Iterator[tuple[int, float]]:
    return ((int(k), float(row[k])) for k in np.flatnonzero(row))


def _collected(Cx: np.ndarray, Ch: np.ndarray, delayed: list[tuple[float, float, Terms]]) -> Terms:
    terms: Terms = {("x", j, 0.0): c for j, c in _entries(Cx)}
    terms.update({("h", j, 0.0): c for j, c in _entries(Ch)})
    for factor, delay, inner in delayed:
        for key, c in _shifted(inner, delay).items():
            terms[key] = terms.get(key, 0.0) + factor * c
    return terms


def _shifted(terms: Terms, lag: float) -> Terms:
    return {(kind, j, round(own + lag, LAG_DIGITS)): c for (kind, j, own), c in terms.items()}


def _needed(x: Sequence[Terms], readings: Sequence[Terms]) -> list[tuple[int, float]]:
    """The pairs (state, lag) that the readings reach, then every state that has no copy yet, undelayed."""
    found: dict[tuple[int, float], None] = {}
    _reach(x, [(j, lag) for terms in readings for kind, j, lag in terms if kind == "x"], found)
    for j in range(len(x)):
        if all(j != other for other, _ in found):
            _reach(x, [(j, 0.0)], found)
    return sorted(found, key=lambda copy: (copy[1], copy[0]))


def _reach(x: Sequence[Terms], wanted: list[tuple[int, float]], found: dict[tuple[int, float], None]) -> None:
    while wanted and len(found) <= MOST_COPIES:
        copy = wanted.pop()
        if copy in found:
            continue
        found[copy] = None
        terms = _shifted(x[copy[0]], copy[1])
        wanted.extend((j, lag) for kind, j, lag in terms if kind == "x")


def _assembled(
    copies: list[tuple[int, float]], rates: list[Terms], q: list[Terms], y: list[Terms]
) -> Expansion:
    pairs = {(j, lag) for terms in [*rates, *q, *y] for kind, j, lag in terms if kind == "h"}
    held = sorted(pairs)
    place = {("x", *copy): i for i, copy in enumerate(copies)}
    place.update({("h", *pair): len(copies) + i for i, pair in enumerate(held)})
    matrices = []
    for rows in (rates, q, y):
        full = np.zeros((len(rows), len(copies) + len(held)))
        for i, terms in enumerate(rows):
            for key, c in terms.items():
                full[i, place[key]] += c
        matrices += [full[:, : len(copies)], full[:, len(copies) :]]
    return Expansion(tuple(copies), tuple(held), *matrices)
