"""The sampled part of a bench for all lanes: samplers, an integral of what they hold, and the command."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from benchmarks.hidden_effects.architecture import Controller
from benchmarks.hidden_effects.ports import Port
from benchmarks.hidden_effects.records import Lane
from benchmarks.hidden_effects.wave import Clock, Wave, held

Array = np.ndarray


class HeldOutput:
    """The output of a sampled block: an update may be missed, then the old value stays."""

    def __init__(self, block: str, lanes: Sequence[Lane], port: Callable[[str], Port], ticks: int) -> None:
        self.port = port(f"{block}.output")
        self.missed = np.zeros((ticks, len(lanes)), dtype=bool)
        for i, lane in enumerate(lanes):
            for e in lane.effects:
                if e.effect == "dropped_frames" and e.port == f"{block}.output":
                    self.missed[:, i] = missed_updates(lane.draws, e.parameters["probability"], ticks)
        self.value = np.zeros(len(lanes))

    def tick(self, number: int, new: Array, clock: Clock) -> Wave:
        """The held signal until the next tick."""
        self.value = np.where(self.missed[number], self.value, new)
        return self.port.apply(held(self.value, clock.count), clock, True, {})


def missed_updates(draws: Array, probability: float, ticks: int) -> Array:
    """Which updates are missed; the first is never."""
    missed = draws[:ticks] < probability
    missed[0] = False
    return missed


class SampledPart:
    """One tick: read, integrate, command."""

    def __init__(
        self, plan: Controller, lanes: Sequence[Lane], port: Callable[[str], Port], rows: int
    ) -> None:
        ticks = rows // plan.period + 2
        self.plan, self.count = plan, len(lanes)
        self.inputs = {block: port(f"{block}.input") for block, _, _ in plan.samplers}
        self.holds = {block: HeldOutput(block, lanes, port, ticks) for block, _, _ in plan.samplers}
        self.input, self.out = port(f"{plan.name}.input"), HeldOutput(plan.name, lanes, port, ticks)
        self.command_weights = _weights(plan.command, lanes)
        self.integral_weights = _weights(plan.integral, lanes) if plan.integral else {}
        self.integral = np.zeros(len(lanes))
        self.readings: dict[str, Array] = {}
        self.wanted = np.zeros(len(lanes))

    def before_tick(self, clock: Clock, signals: Mapping[str, Wave]) -> None:
        """What stands at the sampled inputs at the end of a chunk."""
        for block, signal, _ in self.plan.samplers:
            self.readings[block] = self.inputs[block].apply(signals[signal], clock, False, signals).at[-1]
        if not self.plan.samplers:
            wave = _sum(self.command_weights, signals)
            self.wanted = self.input.apply(wave, clock, False, signals).at[-1]

    def tick(
        self, number: int, clock: Clock, before: Mapping[str, Wave], leading: Mapping[str, Wave]
    ) -> Wave:
        """The command until the next tick."""
        if not self.plan.samplers:
            return self.out.tick(number, self.wanted, clock)
        known = dict(leading)
        for block, _, signal in self.plan.samplers:
            known[signal] = self.holds[block].tick(number, self.readings[block], clock)
        if self.integral_weights:
            known["integral"] = self._integrate(_sum(self.integral_weights, known), clock)
        wave = self.input.apply(_sum(self.command_weights, known), clock, True, known)
        return self.out.tick(number, wave.at[0], clock)

    def _integrate(self, rate: Wave, clock: Clock) -> Wave:
        gained = np.cumsum(0.5 * (rate.a + rate.b), axis=0) * clock.step
        ends = self.integral + gained
        starts = np.concatenate([self.integral[None], ends[:-1]])
        self.integral = ends[-1].copy()
        return Wave(starts, starts, ends)


def _weights(formula: Callable, lanes: Sequence[Lane]) -> dict[str, Array]:
    rows = [formula(lane.values) for lane in lanes]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _sum(weights: Mapping[str, Array], signals: Mapping[str, Wave]) -> Wave:
    total: Wave | None = None
    for name, weight in weights.items():
        part = signals[name].map(lambda x, w=weight: w * x)
        total = part if total is None else total.plus(part)
    assert total is not None
    return total
