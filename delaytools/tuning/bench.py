"""The bench loop against the flight loop: L of both, with symbols for tuning, and exact for the verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.margins import Margins
from delaytools.analysis.opened_loop import open_loop
from delaytools.analysis.questions import loop_margins
from delaytools.blocks.block import Continuous, Sampled, flat_values
from delaytools.blocks.delay import Delay, VariableDelay
from delaytools.blocks.sample_hold import SampleHold
from delaytools.loop.edit import cut, held_at, insert, reader
from delaytools.loop.loop import Element, Loop
from delaytools.loop.port import find_port
from delaytools.loop.symbolic import nominal_values, symbolic_response
from delaytools.loop.trim import readers_at_rest
from delaytools.loop.values import resolve
from delaytools.signals.expression import signal_expression
from delaytools.signals.trouble import DesignError
from delaytools.tuning.noise_gain import block_noise_gain

__all__ = ["Bench", "delay_at_port", "noisy_blocks"]

RealArray = NDArray[np.float64]


@final
@dataclass(frozen=True)
class Bench:
    """A bench loop and the loop that flies, both opened at the signal `at`; `paths` are the values that may move."""

    loop: Loop
    flight: Loop
    at: str
    paths: tuple[str, ...]

    @property
    def nominal(self) -> dict[str, float]:
        """The values that stand at the paths now."""
        return nominal_values(self.loop, self.paths)

    def response(self) -> ca.Function:
        """(omega, p) -> (re, im) of L = -R of the bench, p in the order of `paths`."""
        return _opened_response(self.loop, self.at, self.paths)

    def flight_response(self) -> ca.Function:
        """(omega, p) -> (re, im) of L of the flight loop; values that it has not are read and left alone."""
        own = _known_paths(self.flight, self.paths)
        inner = _opened_response(self.flight, self.at, own)
        omega, p = ca.MX.sym("omega"), ca.MX.sym("p", len(self.paths))
        chosen = ca.vertcat(*[p[self.paths.index(path)] for path in own]) if own else ca.MX(0, 1)
        return ca.Function("flight", [omega, p], list(inner(omega, chosen)))

    def margins(self, values: Mapping[str, float]) -> Margins:
        """The exact margins of the bench loop with these values."""
        return loop_margins(resolve(self.loop, values), self.at).margins[0]

    def flight_margins(self, values: Mapping[str, float]) -> Margins:
        """The exact margins of the flight loop with these values."""
        return loop_margins(self._flying(values), self.at).margins[0]

    def error(self, values: Mapping[str, float], omega: RealArray) -> RealArray:
        """|L_bench/L_flight - 1|² at ω (n,) rad/s, from the numeric linear systems."""
        bench = open_loop(resolve(self.loop, values), self.at).transfer(0.0)
        flight = open_loop(self._flying(values), self.at).transfer(0.0)
        return np.asarray(np.abs(bench.siso(1j * omega) / flight.siso(1j * omega) - 1) ** 2)

    def _flying(self, values: Mapping[str, float]) -> Loop:
        own = _known_paths(self.flight, tuple(values))
        return resolve(self.flight, {path: values[path] for path in own})


def _opened_response(loop: Loop, at: str, paths: Sequence[str]) -> ca.Function:
    opened, name = _opened(loop, at)
    inner = symbolic_response(opened, name, at, free=paths)
    omega, p = ca.MX.sym("omega"), ca.MX.sym("p", len(paths))
    return ca.Function("opened", [omega, p], [-part for part in inner(omega, p)])


def _opened(loop: Loop, at: str) -> tuple[Loop, str]:
    """The loop cut at a signal, and the external input that stands for it; a sequence is held where it is read."""
    period = open_loop(loop, at).period
    name = reader(at)
    broken = held_at(cut(loop, at), readers_at_rest(resolve(loop), [at]))
    if period is None:
        return broken, name
    sampler = Element(
        "cut sampler", SampleHold(period=period), {"input": signal_expression(f"{name} new")}, {"output": name}
    )
    return replace(broken, elements=(*broken.elements, sampler)), f"{name} new"


def _known_paths(loop: Loop, paths: Sequence[str]) -> tuple[str, ...]:
    found = []
    for path in paths:
        try:
            nominal_values(loop, [path])
        except DesignError:
            continue
        found.append(path)
    return tuple(found)


def delay_at_port(loop: Loop, port: str | None) -> tuple[Loop, str]:
    """The loop, and the path of the delay at the port: the one that stands there, or a new one of 0 s.

    Raises DesignError where no port is named or it carries no signal.
    """
    if port is None:
        raise DesignError("at which port does the delay vary?", advice="give delay_at, such as motion_table.input")
    place = find_port(loop, port)
    for element in loop.elements:
        at_port = element.name.partition("@")[2].partition("#")[0] == port
        if isinstance(element.block, Delay) and (at_port or element.name == place.element):
            return loop, f"{element.path}.delay"
        if isinstance(element.block, VariableDelay) and at_port:
            return loop, f"{element.path}.mean"
    mark = Element("varied delay", Delay(delay=0.0), {}, {}, "varied_delay")
    return insert(loop, place, Delay(delay=0.0), element=mark), "varied_delay.delay"


def noisy_blocks(loop: Loop, paths: Sequence[str], of: str | None) -> ca.Function:
    """p -> the largest noise gain over the block `of`, or over every block that a path reaches.

    Raises DesignError where no block is reached.
    """
    p = ca.SX.sym("p", len(paths))
    symbolic = resolve(loop, dict(zip(paths, ca.vertsplit(p) if paths else [], strict=True)))
    chosen = [e for e in symbolic.elements if (e.name == of if of else _moves(e))]
    gains = [block_noise_gain(e.block) for e in chosen if isinstance(e.block, Continuous | Sampled)]
    if not gains:
        raise DesignError(
            "a noise gain is that of a block", where="noise_gain", found=repr(of) if of else "no block that varies",
            known=[e.name for e in loop.elements], advice='name one: of = "compensator"',
        )  # fmt: skip
    return ca.Function("noise_gain", [p], [ca.mmax(ca.vertcat(*gains))])


def _moves(element: Element) -> bool:
    return any(isinstance(v, ca.SX) and not v.is_constant() for v in flat_values(element.block).values())
