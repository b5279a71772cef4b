"""What a segment's signals do under a hypothesis: scales for the starting values of candidates."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.block import CASADI, Continuous
from delaytools.blocks.equations import Equations
from delaytools.blocks.second_order import SecondOrder
from delaytools.diagnosis.added import SEEN, with_added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.loop.loop import Loop
from delaytools.loop.network import network, pushed_by
from delaytools.loop.port import Port, read_at, written_at
from delaytools.loop.values import parameter_values, resolve, with_numbers
from delaytools.signals.expression import Expression

__all__ = ["View", "case_view"]

Array = NDArray[np.float64]
FOLLOWED = 0.9  # correlation with an exit


@final
@dataclass(frozen=True, eq=False)
class View:
    """Signals of a segment and of the log by name, per log (n,); loop: the segment's with the hypothesis in it."""

    case: Case
    loop: Loop
    signals: tuple[dict[str, Array], ...]
    _at: dict[str, tuple[Array, ...]] = field(default_factory=dict, repr=False)

    def at(self, port: Port) -> tuple[Array, ...]:
        """The signal at a port, per log: what enters it, what leaves it, or the rate there."""
        if str(port) not in self._at:
            self._at[str(port)] = self._found_at(port)
        return self._at[str(port)]

    def _found_at(self, port: Port) -> tuple[Array, ...]:
        element = self.loop[port.element]
        if port.kind == "input":
            return tuple(self.evaluated(element.inputs[port.name], log) for log in range(len(self.signals)))
        if port.kind == "output":
            return tuple(known[written_at(self.case.segment.loop, port)] for known in self.signals)
        out = next(iter(element.outputs.values()))
        return tuple(np.gradient(known[out], self.case.step) for known in self.signals)

    def evaluated(self, formula: Expression, log: int) -> Array:
        """(n,): a combination of signals on one log."""
        named = {**parameter_values(self.loop, {}), **self.signals[log]}
        found = np.asarray(formula.evaluate(named, CASADI), dtype=float)
        return np.broadcast_to(found, self.case.records[log].time.shape)

    def is_held(self, port: Port) -> bool:
        """Whether the signal at a port is constant between ticks."""
        if port.kind == "input":
            return self.are_held(self.loop[port.element].inputs[port.name].names)
        return self.are_held((written_at(self.case.segment.loop, port),))

    def are_held(self, names: Iterable[str]) -> bool:
        """Whether signals are constant between ticks, or columns between rows."""
        record = self.case.records[0]
        held = self._held | record.held | {n for n in self.loop.externals if n.removesuffix("@read") in record.held}
        return all(name in held for name in names if name not in self.loop.parameters)

    def is_exit(self, port: Port) -> bool:
        """Whether the port's signal is measured as it leaves its block."""
        return self.case.exit_at(str(port)) is not None

    def before(self, port: Port, log: int) -> float:
        """The signal at a port before the first row: 0 where held signals were at rest then."""
        at_rest = self.is_held(port) and bool(self.case.at_rest & self.case.records[log].held)
        return 0.0 if at_rest else float(self.at(port)[log][0])

    @cached_property
    def _held(self) -> frozenset[str]:
        return network(resolve(self.loop)).held_signals

    def spread(self, port: Port) -> tuple[float, float]:
        """Standard deviation and largest deviation from the mean of the signal at a port."""
        found = np.concatenate([rows - rows.mean() for rows in self.at(port)])
        return float(found.std()), float(np.abs(found).max())

    @property
    def sources(self) -> tuple[str, ...]:
        """Columns of the log that could leak into this segment: all but its own exits.

        Not a sensor of an exit, which shows it nearly as it is: fed back it would make the model an observer, which
        follows any log. In logs of real runs not what an exit follows, either: a reference explains whatever a
        controller makes of it.
        """
        names = tuple(n for n in self.case.records[0].names if n not in self.case.exits and "@" not in n)
        near = names if self.case.pieces else tuple(n for n in names if n in self.case.read_by)
        return tuple(n for n in names if n not in near or not self._followed(n))

    def _followed(self, name: str) -> bool:
        column = np.concatenate([r[name] for r in self.case.records])
        rows = np.concatenate(self.case.measured)
        if np.ptp(column) == 0:
            return False
        return any(abs(np.corrcoef(column, y)[0, 1]) > FOLLOWED for y in rows.T if np.ptp(y) > 0)

    def is_at(self, port: Port, signal: str) -> bool:
        """Whether the signal stands at the port itself, or does nothing but drive the port's derivative.

        A force from a block's own input is a scale factor of it.
        """
        loop = self.case.segment.loop
        element = loop[port.element]
        if port.kind == "derivative":
            alone = len(element.inputs) == 1 and not isinstance(element.block, Equations)
            names = [n for n in element.inputs if alone or self._pushes(element.name, n) == port.name]
            return any(read_at(loop, replace(port, kind="input", name=n)).text.strip() == signal for n in names)
        if port.kind == "input":
            return read_at(loop, port).text.strip() == signal
        return port.kind == "output" and written_at(loop, port) == signal

    def _pushes(self, element: str, name: str) -> str:
        block = resolve(self.case.segment.loop)[element].block
        return pushed_by(block, name) if isinstance(block, Continuous) else ""

    def state_rows(self, port: Port) -> tuple[Array, ...]:
        """The state on whose derivative the port acts, per log, from the outputs of its block."""
        element = self.loop[port.element]
        block = element.block
        if isinstance(block, Equations):
            for name, formula in block.formulas.items():
                if formula.text.strip() == port.name:
                    return tuple(known[element.outputs[name]] for known in self.signals)
        out = next(iter(element.outputs.values()))
        if isinstance(block, SecondOrder | Equations):
            return tuple(np.gradient(known[out], self.case.step) for known in self.signals)
        return tuple(known[out] for known in self.signals)

    def state(self, port: Port) -> float:
        """Root mean square of the state on whose derivative the port acts."""
        return float(np.sqrt(np.mean(np.concatenate(self.state_rows(port)) ** 2)))

    def peak_state(self, port: Port) -> float:
        """Largest magnitude of the state on whose derivative the port acts."""
        return float(np.abs(np.concatenate(self.state_rows(port))).max())

    def derivative(self, port: Port) -> float:
        """Standard deviation of the derivative at the port."""
        return float(np.std(np.concatenate([np.gradient(v, self.case.step) for v in self.state_rows(port)])))

    def position(self, port: Port) -> float:
        """Largest magnitude of the position whose rate is the state at the port."""
        element = self.loop[port.element]
        if isinstance(element.block, SecondOrder):
            out = next(iter(element.outputs.values()))
            return max(float(np.abs(known[out]).max()) for known in self.signals)
        moved = [np.cumsum(v) * self.case.step for v in self.state_rows(port)]
        return max(float(np.abs(x).max()) for x in moved)

    def speed(self, port: Port, rows: int = 10) -> float:
        """Largest rate of change over some rows at a port, in its unit per second."""
        return max(float(np.abs(u[rows:] - u[:-rows]).max()) / (rows * self.case.step) for u in self.at(port))


def case_view(case: Case, fitted: Fitted) -> View:
    """All signals of the segment under a fitted hypothesis, with the log's own columns."""
    loop = case.segment.loop
    numbers = {p.path: p.value for p in fitted.parameters}
    shown = _named(with_numbers(with_added(loop, fitted.added), numbers))
    names = tuple(name for name in shown.signals if name in shown.writers)
    found = []
    for replay, record in zip(case.replays(fitted.added), case.records, strict=True):
        whole = replace(replay, loop=_named(replay.loop), signals=names, _compiled={}, _parts={})
        rows = whole.run(fitted.values)
        read = {name: record[name.partition("@")[0]] for name in shown.externals if name.endswith(("@read", SEEN))}
        found.append({**record.columns, **read, **{name: rows[:, k] for k, name in enumerate(names)}})
    return View(case, shown, tuple(found))


def _named(loop: Loop) -> Loop:
    """The loop with names for the joints between effects and blocks, so that they are signals like others."""
    joints = {s: f"joint_{k}" for k, s in enumerate(loop.writers) if "." in s}
    elements = tuple(
        replace(
            e,
            inputs={port: x.renamed(joints) for port, x in e.inputs.items()},
            outputs={port: joints.get(s, s) for port, s in e.outputs.items()},
        )
        for e in loop.elements
    )
    return replace(loop, elements=elements)
