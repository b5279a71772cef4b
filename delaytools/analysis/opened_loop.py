"""A loop opened at a signal, with an extra delay at a port: the linear systems that every question starts from."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from delaytools.analysis.sampled_margins import SampledLoop
from delaytools.blocks.block import Sampled
from delaytools.blocks.delay import Delay
from delaytools.blocks.gain import Gain
from delaytools.blocks.sample_hold import SampleHold
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.hold_approximation import continuous_approximation
from delaytools.linear.lifted import lift, why_not_liftable
from delaytools.linear.sampled_system import SampledSystem
from delaytools.loop.edit import cut, held_at, insert, reader
from delaytools.loop.linearise import linearise
from delaytools.loop.loop import Element, Loop
from delaytools.loop.port import find_port
from delaytools.loop.trim import readers_at_rest
from delaytools.loop.values import resolve
from delaytools.signals.expression import signal_expression
from delaytools.signals.trouble import DesignError

__all__ = [
    "EXTRA", "OpenedLoop", "open_loop", "opened_at_transports", "scaled_transport", "with_extra_delay", "writer_port",
]  # fmt: skip

EXTRA, SECOND = "extra delay", "second extra delay"
CLOSING = "closing delay"
PLACEHOLDER = 1.0  # s; replaced by the delay asked for


@final
@dataclass(frozen=True)
class OpenedLoop:
    """The loop opened at a signal.

    opened: reader -> signal, with the extra delay as its transport `extra`. held: the same with the reader passing
    a hold where the signal is a sequence, for the continuous approximation. closed: the loop closed again through a
    transport `closing`, with the extra delay as `extra_closed`. period: of the sequence that the signal is (None:
    not sampled). why: why there is no exact sampled answer ("" where there is). without: effects taken at their
    neutral value. second: a further delay of the closed loop, 0 s until it is given.
    """

    opened: SampledSystem
    held: SampledSystem
    closed: SampledSystem
    reader: str
    extra: int
    extra_closed: int
    closing: int
    second: int | None
    period: float | None
    why: str
    without: tuple[str, ...]

    @property
    def exact_sampling(self) -> bool:
        """Whether margins are of the exact pulse transfer."""
        return self.period is not None and not self.why

    def at(self, extra: float) -> SampledSystem:
        """The opened system with the extra delay (s) in place."""
        return _with_delay(self.opened, self.extra, extra)

    def closed_at(self, extra: float, closing: float = 0.0) -> SampledSystem:
        """The closed system with the extra delay (s) and `closing` s at the opened signal's writer."""
        return _with_delay(_with_delay(self.closed, self.extra_closed, extra), self.closing, closing)

    def transfer(self, extra: float) -> DelaySystem:
        """L = -R with the extra delay (s); with sampled blocks, their continuous approximation."""
        return -continuous_approximation(_with_delay(self.held, self.extra, extra))

    def around_extra(self) -> DelaySystem:
        """L = -z/w at the extra delay's own place, all other loops closed: there the delay is in series."""
        return -continuous_approximation(opened_at_transports(self.closed_at(0.0), (self.extra_closed,)))

    def sampled(self, extra: float) -> SampledLoop:
        """The exact sampled loop with the extra delay (s)."""
        assert self.period is not None
        return SampledLoop(self.at(extra), self.reader, self.period, lambda tau: self.closed_at(extra, tau))


def _with_delay(system: SampledSystem, index: int, seconds: float) -> SampledSystem:
    delays = list(system.delays)
    delays[index] = seconds
    return replace(system, delays=tuple(delays))


def opened_at_transports(system: SampledSystem, chosen: tuple[int, ...]) -> SampledSystem:
    """The system with what enters some transports as its only outputs and what leaves them as its only inputs."""
    w, z, at = system.columns("w").start, system.rows("z").start, list(chosen)
    rows, columns = [z + i for i in at], [w + i for i in at]
    matrix = np.vstack([np.delete(system.M[: system.rows("y").start], rows, axis=0), system.M[rows]])
    matrix = matrix[:, : system.columns("e").start]
    matrix = np.hstack([np.delete(matrix, columns, axis=1), matrix[:, columns]])
    delays = tuple(tau for i, tau in enumerate(system.delays) if i not in at)
    exits, entries = (tuple(f"{what} {i}" for i in at) for what in ("exit", "entry"))
    return SampledSystem(matrix, system.n_states, delays, system.samplers, exits, entries, system.state_names)


def scaled_transport(system: SampledSystem, index: int, factor: float) -> SampledSystem:
    """The system with what enters one transport multiplied by a factor."""
    matrix = system.M.copy()
    matrix[system.rows("z").start + index] *= factor
    return replace(system, M=matrix)


def with_extra_delay(loop: Loop, port: str, name: str = EXTRA) -> Loop:
    """The loop with a delay of that name, of a size given later, at the port (`BLOCK.input`, `BLOCK.output`)."""
    place = find_port(loop, port)
    if place.kind not in ("input", "output"):
        raise DesignError(
            "a delay acts on a signal", where=port, found=f"a {place.kind} port", advice="use an input"
        )
    return insert(loop, place, Delay(delay=PLACEHOLDER), element=Element(name, Delay(delay=PLACEHOLDER), {}, {}))


def open_loop(loop: Loop, at: str, delay_at: str | None = None, second_at: str | None = None) -> OpenedLoop:
    """The loop opened at the writer of the signal `at`, with room for an extra delay at the port `delay_at`, and for a
    second one, at `second_at`.

    Without `delay_at`, or with the writer's own port there, the extra delay stands at the opened signal, in front
    of all that read it. Raises DesignError for a signal that no block writes, or an unknown port.
    """
    loop = resolve(loop) if second_at is None else with_extra_delay(resolve(loop), second_at, SECOND)
    name = reader(at)
    own_port = writer_port(loop, at)
    if delay_at is None or delay_at == own_port:
        broken = cut(loop, at, reads=f"{name} late")
        broken = _joined(broken, EXTRA, name, f"{name} late")
    else:
        broken = cut(with_extra_delay(loop, delay_at), at)
    rejoined = _joined(broken, CLOSING, at, name)
    period = _period(loop, at)
    broken = held_at(broken, readers_at_rest(loop, [at]))
    opened, closed = linearise(broken, [name], [at]), linearise(rejoined, [], [at])
    held = opened if period is None else linearise(_sampled_reader(broken, name, period), [f"{name} new"], [at])
    return OpenedLoop(
        opened.system,
        held.system,
        closed.system,
        name,
        _index(broken, EXTRA),
        _index(rejoined, EXTRA),
        _index(rejoined, CLOSING),
        None if second_at is None else _index(rejoined, SECOND),
        period,
        _why_not_exact(opened.system, name, period),
        opened.without,
    )


def _joined(loop: Loop, name: str, source: str, target: str) -> Loop:
    """The loop with a delay, of a size given later, from one signal to another."""
    wiring = {"input": signal_expression(source)}, {"output": target}
    return replace(loop, elements=(*loop.elements, Element(name, Delay(delay=PLACEHOLDER), *wiring)))


def _sampled_reader(loop: Loop, name: str, period: float) -> Loop:
    """The loop whose cut signal is sampled on its way in, so that its hold is charged where it is read."""
    wiring = {"input": signal_expression(f"{name} new")}, {"output": name}
    return replace(loop, elements=(*loop.elements, Element("cut sampler", SampleHold(period=period), *wiring)))


def writer_port(loop: Loop, signal: str) -> str:
    """The output port behind which a signal is written, after the effects that act there."""
    if signal not in loop.writers:
        known = [name for name in loop.signals if name in loop.writers]
        raise DesignError(
            "the loop can be opened where a block writes a signal", found=repr(signal), known=known
        )
    element, port = loop.writers[signal]
    return element.partition("@")[2].partition("#")[0] if "@" in element else f"{element}.{port}"


def _why_not_exact(system: SampledSystem, name: str, period: float | None) -> str:
    if not system.samplers:
        return ""
    if period is None:
        return "the signal is not written by a sampled block"
    why = why_not_liftable(system, {name: period})
    if why:
        return why
    lifted = lift(system, {name: period})
    if lifted is None or lifted.input_matrix.shape[1] == 0 or abs(lifted.period - period) > 1e-9 * period:
        return "several rates: the loop repeats after more than one sample of the signal"
    return ""


def _index(loop: Loop, name: str) -> int:
    return [element.name for element in loop.transports].index(name)


def _period(loop: Loop, signal: str) -> float | None:
    """The period of the sampled block that writes the signal, through wires and gains; None where none does."""
    writers = loop.writers
    while signal in writers:
        element = loop[writers[signal][0]]
        if isinstance(element.block, Sampled):
            return float(element.block.period)
        names = [n for x in element.inputs.values() for n in x.names if n not in loop.parameters]
        if not isinstance(element.block, Gain) or len(names) != 1:
            return None
        signal = names[0]
    return None
