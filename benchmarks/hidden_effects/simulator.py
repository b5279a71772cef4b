"""The truth: one architecture, many lanes, chunk by chunk from tick to tick of the controller.

Between two ticks a bench is a chain: held command -> block -> block -> ... -> sensors. So each chunk is run block after
block; only the ticks close the loop. A shadow lane is driven, segment by segment, by its parent's measured signals.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.hidden_effects.architecture import Architecture, BlockPlan, Output, stack
from benchmarks.hidden_effects.blocks import Block, output
from benchmarks.hidden_effects.controller import SampledPart
from benchmarks.hidden_effects.ports import Port
from benchmarks.hidden_effects.records import Acts, Lane
from benchmarks.hidden_effects.wave import Clock, Wave, held

Array = np.ndarray
ROW = 1e-3  # s
NOT_IN_WIRES = ("dropped_frames", "parameter_change")


def simulate(
    architecture: Architecture,
    lanes: Sequence[Lane],
    rows: int,
    steps_per_row: int = 10,
    driven: Mapping[str, Array] | None = None,
    thin: bool = False,
) -> dict[str, Array]:
    """Measured signals, rows x lanes; pick-off noise outside the loop is not in them.

    driven: measured rows of all measured signals; then every segment is run from its measured input, not as a loop.
    thin: only the last row before every tick is kept.
    """
    run = _Run(architecture, lanes, rows, steps_per_row)
    if driven:
        run.drive(driven, rows)
    run.open_logs(rows, thin)
    with np.errstate(all="ignore"):
        run.instant()
        for chunk in range(-(-rows // architecture.controller.period)):
            run.chunk(chunk)
    every = architecture.controller.period if thin else 1
    return {name: log[: rows // every] for name, log in run.logs.items()}


class Table:
    """Rows of a signal; lanes of one case share a column."""

    def __init__(self, columns: Array, column_of_lane: Array) -> None:
        self.columns, self.column_of_lane = columns, column_of_lane

    def rows(self, first: int, count: int) -> Array:
        """Some rows, for every lane."""
        return self.columns[first : first + count][:, self.column_of_lane]

    def points(self, weights: Array, first_row: int) -> Array:
        """The fine grid of a chunk, linear between rows."""
        return (weights @ self.columns[first_row : first_row + weights.shape[1]])[:, self.column_of_lane]


def _at_start(table: Table) -> Wave:
    return Wave(table.rows(0, 1), table.rows(0, 0), table.rows(0, 0))


class _Run:
    def __init__(
        self, architecture: Architecture, lanes: Sequence[Lane], rows: int, steps_per_row: int
    ) -> None:
        self.plan, self.lanes, self.per_row = architecture, lanes, steps_per_row
        self.step = ROW / steps_per_row
        self.period = architecture.controller.period
        self.count = self.period * steps_per_row
        self.parents = np.array([i if lane.parent is None else lane.parent for i, lane in enumerate(lanes)])
        self.shadows = bool((self.parents != np.arange(len(lanes))).any())
        self.rows = {name: self._stack_rows(name, rows, False) for name in architecture.externals}
        self.noise = {name: self._stack_rows(name, rows, True) for name in architecture.inside_noise}
        self.noise_first = np.array([float(lane.noise_first) for lane in lanes])
        self.ports: dict[str, Port] = {}
        self.crossing = {p: self._crossing(p) for plan in architecture.chain for p in plan.force_ports}
        values = [lane.values for lane in lanes]
        outputs = [o for plan in architecture.chain for o in plan.outputs]
        self.readings = {o.signal: (stack(o.C, values), stack(o.D, values)) for o in outputs}
        self.blocks = [self._block(plan) for plan in architecture.chain]
        self.sampled = SampledPart(architecture.controller, lanes, self.port, rows)
        self.signals: dict[str, Wave] = {}
        self.driven: dict[str, Table] = {}
        self.logs: dict[str, Array] = {}
        self.thin = False
        fractions = np.arange(self.count + 1) / steps_per_row
        self.weights = np.maximum(0.0, 1 - np.abs(fractions[:, None] - np.arange(self.period + 1)[None, :]))

    def _stack_rows(self, name: str, rows: int, noise: bool) -> "Table":
        columns = [(lane.noise if noise else lane.externals).get(name) for lane in self.lanes]
        distinct = {id(c): c for c in columns}
        order = {key: i for i, key in enumerate(distinct)}
        table = np.stack([np.zeros(rows) if c is None else c[:rows] for c in distinct.values()], axis=1)
        table = np.concatenate([table, np.repeat(table[-1:], self.period + 1, axis=0)])
        return Table(table, np.array([order[id(c)] for c in columns]))

    def open_logs(self, rows: int, thin: bool) -> None:
        """Room for the measured signals."""
        self.thin = thin
        ticks = rows // self.period + 2
        total = ticks if thin else ticks * self.period + 1
        self.logs = {name: np.zeros((total, len(self.lanes))) for name in self.plan.measured}

    def _log(self, signal: str, at: Array, first_row: int, leading: bool) -> None:
        """Rows of one chunk: a held signal's from its tick, a continuous one's from the row after."""
        log = self.logs[signal]
        if self.thin:
            log[first_row // self.period] = at[-1]
        elif len(at) == 1:
            log[0] = at[0]
        elif leading:
            log[first_row : first_row + self.period] = at[:: self.per_row]
        else:
            log[first_row + 1 : first_row + 1 + self.period] = at[self.per_row - 1 :: self.per_row]

    def drive(self, measured: Mapping[str, Array], rows: int) -> None:
        """Every segment from its measured input."""
        ends = self.period + 1
        for name, column in measured.items():
            long = np.concatenate([column[:rows], np.full(ends, column[rows - 1])])
            self.driven[name] = Table(long[:, None], np.zeros(len(self.lanes), dtype=int))

    def port(self, name: str) -> Port:
        """The effects at a port in all lanes."""
        if name not in self.ports:
            wired = [[e for e in lane.effects if e.port == name] for lane in self.lanes]
            self.ports[name] = Port(
                [[e for e in lane if not e.effect.startswith(NOT_IN_WIRES)] for lane in wired]
            )
        return self.ports[name]

    def _block(self, plan: BlockPlan) -> Block:
        values = [lane.values for lane in self.lanes]
        A, B = (stack(lambda v, i=i: plan.system(v)[i], values) for i in (0, 1))
        return Block(A, B, self.step, plan.force_ports, [_acts(plan, lane) for lane in self.lanes])

    def _crossing(self, port: str) -> dict[str, Array]:
        """Gain of every source that is coupled into a derivative."""
        gains: dict[str, Array] = {}
        for i, lane in enumerate(self.lanes):
            for e in lane.effects:
                if e.port == port and e.effect == "cross_coupling":
                    gains.setdefault(e.source or "", np.zeros(len(self.lanes)))[i] += e.parameters["gain"]
        return gains

    def instant(self) -> None:
        """t = 0, before the first tick: everything continuous has its first value."""
        self.signals = {n: _at_start(r) for n, r in self.rows.items()}
        empty = np.zeros((0, len(self.lanes)))
        self.signals[self.plan.controller.command_signal] = Wave(np.zeros((1, len(self.lanes))), empty, empty)
        self._chain(Clock(0, 0, self.step), 0)

    def chunk(self, number: int) -> None:
        """From one tick to the next."""
        first_row = number * self.period
        clock = Clock(number * self.count, self.count, self.step)
        before = self.signals
        points = {name: r.points(self.weights, first_row) for name, r in self.rows.items()}
        leading = {name: Wave(p[:-1], p[:-1], p[1:]) for name, p in points.items()}
        command = self.sampled.tick(number, clock, before, leading)
        name = self.plan.controller.command_signal
        self._log(name, command.at, first_row, True)
        command = self._shared(command)
        if name in self.driven:
            command = held(self.driven[name].rows(first_row, 1)[0], self.count)
        self.signals = {n: Wave(p[1:], p[:-1], p[1:]) for n, p in points.items()}
        self.signals[name] = Wave(command.b, command.a, command.b)
        self._chain(clock, first_row)

    def _shared(self, wave: Wave) -> Wave:
        return wave.take(self.parents) if self.shadows else wave

    def _chain(self, clock: Clock, first_row: int) -> None:
        for plan, block in zip(self.plan.chain, self.blocks, strict=True):
            u = self.port(f"{plan.name}.{plan.input_port}").apply(
                self.signals[plan.input], clock, False, self.signals
            )
            cross = {p: self._push(g) for p in plan.force_ports if (g := self.crossing[p]) and clock.count}
            path = block.run(u, cross)
            for out in plan.outputs:
                self._write(plan, out, path, u, clock, first_row)
        self.sampled.before_tick(clock, self.signals)

    def _push(self, gains: dict[str, Array]) -> Wave:
        parts = [self.signals[source].map(lambda x, g=gain: g * x) for source, gain in gains.items()]
        return parts[0] if len(parts) == 1 else Wave(*(sum(p) for p in zip(*parts, strict=True)))

    def _write(
        self, plan: BlockPlan, out: Output, path: Array, u: Wave, clock: Clock, first_row: int
    ) -> None:
        wave = output(path, *self.readings[out.signal], u, clock)
        noise = self._from_rows(self.noise, out.signal, clock, first_row)
        if noise is not None:
            wave = wave.plus(noise, self.noise_first)
        wave = self.port(f"{plan.name}.{out.port}").apply(wave, clock, False, self.signals)
        if noise is not None:
            wave = wave.plus(noise, 1 - self.noise_first)
        self._log(out.signal, wave.at, first_row, False)
        rows = self._from_rows(self.driven, out.signal, clock, first_row)
        self.signals[out.signal] = self._shared(wave) if rows is None else rows

    def _from_rows(
        self, tables: Mapping[str, "Table"], signal: str, clock: Clock, first_row: int
    ) -> Wave | None:
        if signal not in tables:
            return None
        if clock.count == 0:
            return _at_start(tables[signal])
        p = tables[signal].points(self.weights, first_row)
        return Wave(p[1:], p[:-1], p[1:])


def _acts(plan: BlockPlan, lane: Lane) -> Acts:
    """What acts inside this block in this lane."""
    inside = [e for e in lane.effects if e.port in plan.force_ports]
    forces = tuple((e.port, e.effect, e.parameters) for e in inside)
    limits = [e.parameters["limit"] for e in lane.effects if e.port == plan.rate_port]
    return Acts(forces, min(limits, default=np.inf), plan.smoothing)
