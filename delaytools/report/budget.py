"""The delay budget: what each element on the way round costs, alone, and what is left."""

import re
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.margins import Margins
from delaytools.analysis.questions import transfer
from delaytools.blocks.block import Sampled
from delaytools.blocks.gain import Gain
from delaytools.loop.linearise import without_amplitude_effects
from delaytools.loop.loop import Element, Loop
from delaytools.loop.values import resolve
from delaytools.report.cases import Case
from delaytools.report.signal_graph import longest_cycle, on_cycles, on_every_cycle, signal_graph
from delaytools.signals.expression import signal_expression

__all__ = ["Budget", "BudgetEntry", "budget"]

ENTRY = "entry"


@final
@dataclass(frozen=True)
class BudgetEntry:
    """One element alone.

    delay: -d(phase)/dω at ω = 0 in s (None at a pole or zero there); phase: rad at the gain crossover (None where
    there is none). bench: does not fly. series: every way round passes it. added: it acts as a delay at the
    crossover and counts in the total. note: in words, why it is not added, or what stands in the number.
    """

    name: str
    kind: str
    delay: float | None
    phase: float | None
    bench: bool
    series: bool
    added: bool
    note: str


@final
@dataclass(frozen=True)
class Budget:
    """The elements of the longest way round, in their order from the opened signal on.

    crossover in rad/s (None: |L| never is 1); delay_margin in s, None where `why` says why.
    """

    name: str
    crossover: float | None
    entries: tuple[BudgetEntry, ...]
    loop_phase: float | None
    delay_margin: float | None
    why: str

    @property
    def total(self) -> float:
        """The sum of the delays that are added, s."""
        return sum(entry.delay or 0.0 for entry in self.entries if entry.added)

    @property
    def bench_total(self) -> float:
        """Of these, the delay of equipment that does not fly, s."""
        return sum(entry.delay or 0.0 for entry in self.entries if entry.added and entry.bench)

    @property
    def series_phase(self) -> float:
        """The sum of the phases of the elements in series at the crossover, rad."""
        return sum(entry.phase or 0.0 for entry in self.entries if entry.series)


def budget(case: Case, at: str, margins: Margins, removed: frozenset[str]) -> Budget:
    """The budget of one case; `removed`: names of blocks that do not fly."""
    loop = without_amplitude_effects(resolve(case.loop))[0]
    graph, start = signal_graph(loop), loop.writers[at][0]
    way, series = longest_cycle(graph, start), on_every_cycle(graph, start)
    way = way[1:] + way[:1]  # from what reads the opened signal round to its writer
    crossover, phase = _crossover(margins)
    entries = []
    for before, name, after in _triples(way):
        element = loop[name]
        if isinstance(element.block, Gain):
            continue
        bench = name in removed or name.partition("@")[2].partition(".")[0] in removed
        entries.append(_entry(loop, (before, name, after), crossover, bench, name in series))
    why = margins.why.get("delay_margin", "")
    return Budget(case.name, crossover, tuple(entries), phase, margins.delay_margin, why)


def _crossover(margins: Margins) -> tuple[float | None, float | None]:
    """(ω in rad/s, arg L in rad) at the gain crossing that the phase margin belongs to, else the highest one."""
    gains = [c for c in margins.crossings if c.kind == "gain" and 0 < c.frequency < np.inf]
    if not gains:
        return None, None
    wanted = margins.phase_margin_frequency
    chosen = gains[-1] if wanted is None else min(gains, key=lambda c: abs(c.frequency - wanted))
    return chosen.frequency, chosen.phase


def _triples(way: tuple[str, ...]) -> list[tuple[str, str, str]]:
    return [(way[i - 1], name, way[(i + 1) % len(way)]) for i, name in enumerate(way)]


def _entry(
    loop: Loop, place: tuple[str, str, str], crossover: float | None, bench: bool, series: bool
) -> BudgetEntry:
    before, name, after = place
    element = loop[name]
    delay, phase = _alone(loop, element, before, after, crossover)
    hold, note = _hold(loop, element, on_cycles(signal_graph(loop), name))
    if hold and delay is not None:
        delay += hold
    if hold and phase is not None and crossover is not None:
        phase -= hold * crossover
    like = _acts_as_delay(delay, phase, crossover)
    if not series:
        note = "beside another way round: not added"
    elif not like:
        note = "shapes the loop, is no delay at the crossover: not added"
    kind = re.sub(r"(?<!^)(?=[A-Z])", " ", type(element.block).__name__).lower()
    return BudgetEntry(name, kind, delay, phase, bench, series, series and like, note)


def _acts_as_delay(delay: float | None, phase: float | None, crossover: float | None) -> bool:
    """Whether the phase at the crossover is near -ω·delay: a lag far slower than the loop is no delay of it."""
    if delay is None:
        return False
    if phase is None or crossover is None:
        return True
    return abs(phase + crossover * delay) <= 0.35 * abs(crossover * delay) + 1e-9


def _hold(loop: Loop, element: Element, inside: set[str]) -> tuple[float, str]:
    """Half a period, unless a reader on a way round takes the sequence at the same instants; and words for it."""
    block = element.block
    if not isinstance(block, Sampled):
        return 0.0, ""
    for reader in _readers(loop, element.name, inside):
        other = loop[reader].block
        if isinstance(other, Sampled) and abs(float(other.period) - float(block.period)) < 1e-9:
            return 0.0, f"read by {reader} at the same instants: no hold"
    return float(block.period) / 2, f"half the period of {float(block.period) * 1e3:g} ms"


def _readers(loop: Loop, name: str, inside: set[str]) -> list[str]:
    """The elements on a way round that read the element, through gains."""
    graph, found = signal_graph(loop), list[str]()
    waiting = [name]
    while waiting:
        for reader in graph[waiting.pop()]:
            if reader in inside and reader not in found and reader != name:
                found.append(reader)
                if isinstance(loop[reader].block, Gain):
                    waiting.append(reader)
    return found


def _alone(
    loop: Loop, element: Element, before: str, after: str, crossover: float | None
) -> tuple[float | None, float | None]:
    """(delay at ω = 0 in s, phase at the crossover in rad) of the element alone, holds left out."""
    port, out = _ports(loop, element, before, after)
    wired = {name: signal_expression(f"other {name}") for name in element.inputs}
    single = Loop(
        (replace(element, inputs={**wired, port: signal_expression(ENTRY)}),),
        loop.parameters,
        frame=loop.frame,
    )
    system = transfer(single, ENTRY, out)
    phase = None if crossover is None else float(_turned(system.siso, crossover))
    step = 1e-4 * (crossover or 1.0)
    near = np.asarray(system.siso(1j * np.array([step, 2 * step])))
    at_zero = complex(system.siso(0.0))
    if not np.isfinite(at_zero) or abs(at_zero) < 1e-12 * max(1e-300, float(np.abs(near).max())):
        return None, phase
    turn = float(np.angle(near[0] / at_zero))
    return (-turn / step if abs(turn) > 1e-13 else 0.0), phase


def _turned(response: object, crossover: float) -> float:
    """arg G(jω)/sign G(0+) in rad, followed from low frequency on, so that long delays are not wrapped."""
    omega = np.concatenate([np.geomspace(1e-4, 1.0, 200)[:-1], [1.0]]) * crossover
    values: NDArray[np.complex128] = np.asarray(response(1j * omega))  # type: ignore[operator]
    phase = np.unwrap(np.angle(values))
    first = phase[0]
    start = first - np.pi * np.round(first / np.pi) if abs(np.sin(first)) < 0.1 else first
    if abs(np.cos(first)) < 0.1:  # an integrator or a differentiator
        start = -np.pi / 2 if np.abs(values[0]) > np.abs(values[-1]) else np.pi / 2
    return float(phase[-1] - first + start)


def _ports(loop: Loop, element: Element, before: str, after: str) -> tuple[str, str]:
    """(input port fed by `before`, output signal read by `after`)."""
    fed, read = set(loop[before].outputs.values()), set(_reads(loop[after]))
    port = next(p for p, expression in element.inputs.items() if fed & set(expression.names))
    return port, next(signal for signal in element.outputs.values() if signal in read)


def _reads(element: Element) -> list[str]:
    names = [n for expression in element.inputs.values() for n in expression.names]
    return names + [n for placed in element.modifiers for n in placed.modifier.sources]
