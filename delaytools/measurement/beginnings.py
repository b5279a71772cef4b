"""States that begin anew with each piece of a log: what the log shows of them, and the beginnings that fit best."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import Continuous
from delaytools.loop.loop import Element, Loop
from delaytools.loop.network import Key, position_of
from delaytools.loop.port import written_behind
from delaytools.loop.values import resolve
from delaytools.signals.record import Record
from delaytools.simulation.replay import Replay

__all__ = ["Begun", "run_begun", "starts_shown"]

Array = NDArray[np.float64]
NEIGHBOURS = 6  # rows on either side by which the value and the rate at a beginning are taken from a log


def starts_shown(loop: Loop, record: Record, rows: Sequence[int]) -> tuple[tuple[int, Mapping[Key, float]], ...]:
    """Per row where a piece begins: every continuous state's value there.

    A state that an output shows takes the measured value, the rate of such a state the measured slope; others take
    the value that the design begins with at the log's first row, and later the one that the run has there (NaN).
    """
    whole = resolve(loop)
    blocks = [e for e in whole.elements if isinstance(e.block, Continuous) and e.block.states]
    return tuple((row, {k: v for e in blocks for k, v in _shown(whole, e, record, row).items()}) for row in rows)


def _shown(loop: Loop, element: Element, record: Record, row: int) -> dict[Key, float]:
    block = element.block
    assert isinstance(block, Continuous)
    found = {s: float(v) if row == 0 else np.nan for s, v in zip(block.states, block.initial_state, strict=True)}
    x, u = [ca.SX.sym(s) for s in block.states], [ca.SX.sym(name) for name in block.inputs]
    for port, formula in zip(block.outputs, block.output(ca.SX.sym("t"), x, u), strict=True):
        for state, symbol in zip(block.states, x, strict=True):
            signal = written_behind(loop, element.outputs[port])
            if signal in record and isinstance(formula, ca.SX) and ca.is_equal(formula, symbol, 1):
                found[state], slope = _value_and_slope(record, signal, row)
                found |= {rate: slope for rate in block.states if rate != state and position_of(block, rate) == state}
    return {(element.name, state): value for state, value in found.items()}


def _value_and_slope(record: Record, signal: str, row: int) -> tuple[float, float]:
    near = slice(max(0, row - NEIGHBOURS), row + NEIGHBOURS + 1)
    t, y = record.time[near] - record.time[row], record[signal][near]
    span = float(np.abs(t).max())
    curve = np.polynomial.polynomial.polyfit(t / span, y, 2)
    return float(curve[0]), float(curve[1]) / span


@final
@dataclass(frozen=True, eq=False)
class Begun:
    """What free beginnings of the pieces of one log can do at its exits.

    columns (n, exits, states): response to each state's value at the last beginning. own: which states begin anew
    with every piece; the others begin once. filters: per exit, what whitens its rows; () weighs by `scale` (exits,).
    """

    pieces: tuple[tuple[int, int], ...]
    columns: Array
    own: NDArray[np.bool_]
    filters: tuple[Callable[[Array], Array], ...]
    scale: Array

    def filtered(self, rows: Array) -> Array:
        """(pieces' rows · exits, k): rows (n, exits, k) through the filters, piece by piece."""
        return np.concatenate([self._piece(rows[a:b]) for a, b in self.pieces])

    def _piece(self, rows: Array) -> Array:
        if self.filters:
            return np.concatenate([f(rows[:, j]) for j, f in enumerate(self.filters)])
        return np.concatenate([rows[:, j] / self.scale[j] for j in range(rows.shape[1])])

    def without(self, rows: Array) -> Array:
        """Rows (n, exits, k) less the best that beginnings can do, by least squares; 0 outside the pieces."""
        found = np.zeros_like(rows)
        both = np.concatenate([rows, self.columns[:, :, ~self.own]], axis=2)
        for a, b in self.pieces:
            both[a:b] = _projected(self._piece, both[a:b], self.columns[a:b][:, :, self.own])
            found[a:b] = both[a:b, :, : rows.shape[2]]
        once = np.zeros_like(both[:, :, rows.shape[2] :])
        for a, b in self.pieces:
            once[a:b] = both[a:b, :, rows.shape[2] :]
        return _projected(self.filtered, found, once)


def run_begun(
    replay: Replay,
    values: tuple[float, ...],
    measured: Array,
    pieces: tuple[tuple[int, int], ...],
    filters: tuple[Callable[[Array], Array], ...] = (),
) -> tuple[Array, Begun]:
    """(n, exits) of a run whose pieces begin as the replay says, and what other beginnings would do to it.

    measured (n, exits): its spread weighs the exits against each other where there are no filters.
    """
    rows, columns = replay.run_with_starts(values)
    anew = {state for _, states in replay.begins for state in states}
    own = np.array([state in anew for state in replay.starts(values)], dtype=bool)
    spread = measured.std(axis=0)
    return rows, Begun(pieces, columns, own, filters, np.where(spread > 0, spread, 1.0))


def _projected(filtered: Callable[[Array], Array], rows: Array, columns: Array) -> Array:
    if not columns.shape[2] or not np.any(columns):
        return rows
    if not (np.isfinite(rows).all() and np.isfinite(columns).all()):
        return np.full_like(rows, np.inf)
    weights = np.linalg.lstsq(filtered(columns), filtered(rows), rcond=1e-9)[0]
    return np.asarray(rows - columns @ weights)
