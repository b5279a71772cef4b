"""The rest of a loop: which states and inputs hold chosen signals at chosen values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.loop.edit import held_at, reader
from delaytools.loop.linearise import Formulas, formulas, operating_point, rest
from delaytools.loop.loop import Loop
from delaytools.signals.trouble import AnalysisError, DesignError

__all__ = ["Trim", "readers_at_rest", "trim"]

_NOTHING = 1e-9  # in any unit: what solving leaves of a zero


@final
@dataclass(frozen=True)
class Trim:
    """A rest. inputs: external input -> value in its unit, all of them; signals and states likewise.

    loop: with these inputs held, so that what it is asked is asked about this rest. without: effects that linear
    analysis leaves out (`TYPE@PORT`), and this rest too.
    """

    loop: Loop
    inputs: Mapping[str, float]
    signals: Mapping[str, float]
    states: Mapping[str, float]
    without: tuple[str, ...]

    @property
    def is_off_zero(self) -> bool:
        """Whether anything is not zero here, but for what solving leaves."""
        return any(abs(value) > _NOTHING for value in self.signals.values())


def trim(
    loop: Loop,
    held: Mapping[str, float] | None = None,
    *,
    wanted: Mapping[str, float] | None = None,
    by: Sequence[str] = (),
) -> Trim:
    """Where the loop rests with external inputs held at values (others at 0), or at those of `by` that bring about
    what is wanted of signals.

    held, wanted: name -> value in its unit. by: external inputs that are sought, one for each wanted signal. Of several
    rests the one that least squares reach from the blocks' initial states.
    Raises DesignError for an unknown name, AnalysisError where there is no such rest.
    """
    wanted = dict(wanted or {})
    if len(wanted) != len(by):
        raise AnalysisError(
            "one input is sought for each wanted signal", found=f"{len(wanted)} wanted, {len(by)} inputs",
            advice="name as many inputs in `by`",
        )  # fmt: skip
    both = set(by) & set(held or {})
    if both:
        raise AnalysisError("an input is held or sought", found=", ".join(sorted(both)))
    loop = held_at(loop, held or {})
    for name in by:
        if name not in loop.externals:
            raise DesignError("not an external input", found=repr(name), known=loop.externals)
    for name in wanted:
        if name not in loop.signals:
            raise DesignError("unknown signal", found=repr(name), known=loop.signals)
    totals = {name: whole for name in loop.externals if (whole := f"{name}@held") in loop.writers}
    lines = formulas(loop, [*loop.signals, *totals.values()])
    symbols, point = lines.symbols, rest(lines, wanted, by)
    added = dict(zip(symbols.externals, point[len(point) - len(symbols.externals) :].tolist(), strict=True))
    known = _outputs_at(lines, point)
    signals = {name: known[totals.get(name, name)] for name in loop.signals}
    states = {f"{element}.{name}": float(x) for (element, name), x in zip(symbols.states, point, strict=False)}
    return Trim(
        held_at(loop, {name: added[name] for name in by}), {name: signals[name] for name in added}, signals, states,
        lines.without,
    )  # fmt: skip


def _outputs_at(lines: Formulas, point: NDArray[np.float64]) -> dict[str, float]:
    rows = np.asarray(ca.Function("rows", [lines.symbols.all], [lines.rows])(point)).ravel()
    return dict(zip(lines.outputs, rows[len(rows) - len(lines.outputs) :].tolist(), strict=True))


def readers_at_rest(loop: Loop, signals: Sequence[str]) -> dict[str, float]:
    """Of signals that are not zero where the loop rests: the name under which a cut loop reads each -> its value.

    A loop that is opened there is asked about the closed loop's rest, not about that of what is left of it.
    """
    lines = formulas(loop, signals)
    point = operating_point(lines)
    if not point.any():
        return {}
    return {reader(name): value for name, value in _outputs_at(lines, point).items() if value}
