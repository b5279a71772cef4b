"""Truth simulator of piecewise-smooth delay systems: the method of steps, restarted at every breakpoint.

Breakpoints are: ticks of samplers, jumps of inputs, arrivals of held jumps (tick + delay; for a delay that
varies the root of t - tau(t) = tick), kinks that travel through continuous delays (up to the 6th derivative),
and the length limit start = t - tau(t), so that a continuous delay only ever reads what is already solved.

Rules: before t = 0 every signal has its initial value; samplers update at 0, T, 2T, ... in the order listed,
from the values at that instant; a held signal delayed is a held signal; at an arrival or a jump the new value
counts. Needs tau(t) > 0 and tau'(t) < 1 (each value arrives once, in order). Formulas are smooth between
breakpoints: dead bands, limits and the like may only act on held signals.
"""

import heapq
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tests.truth.integrators import Field, Integrator, Solution, collocation

Array = NDArray[np.float64]
Value = Any                     # a float, or an array with one entry per instant
Formula = Callable[["Values"], Value]

SAME_TIME = 1e-11               # s; events closer than this are one event (they differ by rounding only)
JUST_AFTER = 1e-7               # s; marks the side from which an event is looked at
NUDGE = 1e-3                    # share of the way to that side by which a looked-up instant is moved
SMOOTH = 6                      # a jump in a derivative of a rate beyond this order is no breakpoint


@dataclass(frozen=True)
class Input:
    """External input: `pieces[i]` is a formula of t that holds from `breaks[i-1]` to `breaks[i]`."""

    pieces: tuple[Callable[[Value], Value], ...]
    breaks: tuple[float, ...] = ()


@dataclass(frozen=True)
class Sampler:
    """Sampled block: `update` gives the held output at t = 0, T, 2T, ...; it may read its own old output."""

    output: str
    period: float
    update: Formula
    initial: float = 0.0


@dataclass(frozen=True)
class Delay:
    """output(t) = source(t - tau(t)), and `before` while t - tau(t) < 0.

    `held`: the source is a sampler's output (or such an output delayed). `smoothing`: a jump in the k-th
    derivative of the rates jumps in the derivative k + smoothing of the source (1: the source is a formula of
    states; more if it lies behind further states; 0: it reads a held signal, an input or a delay directly).
    """

    source: str
    tau: Callable[[float], float]
    held: bool = False
    before: float = 0.0
    smoothing: int = 1


@dataclass(frozen=True)
class System:
    """Rates of the states, and formulas by name; each reads states, inputs, held and delayed signals."""

    states: Mapping[str, float]
    rates: Callable[["Values"], Sequence[Value]]
    inputs: Mapping[str, Input] = field(default_factory=dict)
    samplers: tuple[Sampler, ...] = ()
    delays: Mapping[str, Delay] = field(default_factory=dict)
    signals: Mapping[str, Formula] = field(default_factory=dict)


@dataclass(frozen=True)
class Stretch:
    """A solved, smooth part of the run; `held` are the held signals on it."""

    start: float
    end: float
    held: Mapping[str, float]
    solution: Solution


class Values(dict[str, Any]):
    """Signals at one instant (or several, as arrays), seen from the moment `side`; found when first read."""

    def __init__(self, run: "Run", t: Value, side: float, known: Mapping[str, Value]) -> None:
        self.run, self.side = run, side
        self["t"] = t
        self.update(known)

    def __missing__(self, name: str) -> Value:
        system = self.run.system
        if name in system.signals:
            value = system.signals[name](self)
        elif name in system.inputs or name in system.delays:
            value = self.run.given(name, self["t"], self.side)
        else:
            raise KeyError(f"no state, input, sampler, delay or signal is called {name!r}")
        self[name] = value
        return value


class Run:
    """A run in progress: solved stretches, held values, and the queue of events."""

    def __init__(self, system: System, integrator: Integrator) -> None:
        self.system, self.integrator = system, integrator
        self.stretches: list[Stretch] = []
        self.starts: list[float] = []
        self.state = np.array(list(system.states.values()), dtype=float)
        self.full = np.abs(self.state)
        self.held = {s.output: s.initial for s in system.samplers}
        self.held |= {name: d.before for name, d in system.delays.items() if d.held}
        self.continuous = {name: d for name, d in system.delays.items() if not d.held}
        self.queue: list[tuple[float, int, str, Any]] = []
        self.number = count()
        self._announce("kink", 0.0, 0)
        for sampler in system.samplers:
            self._announce("tick", 0.0, (sampler, 0))
        for moment in (b for one in system.inputs.values() for b in one.breaks if b >= 0):
            self._announce("kink", moment, 0)

    def to(self, duration: float) -> "Run":
        """Solve up to `duration`, the events at that instant included."""
        now = 0.0
        while True:
            self._events(now)
            if now > duration - SAME_TIME:
                break
            now = self._solve(now, self._next(now, duration))
        self._keep(now, now + JUST_AFTER, lambda t, last=self.state: _constant(last, t))
        return self

    def given(self, name: str, t: Value, side: float) -> Value:
        """An input or a delayed continuous signal, which need no present state."""
        if name in self.system.inputs:
            one = self.system.inputs[name]
            nudged = t + NUDGE * (side - t)
            return _by_group(t, nudged, lambda n: bisect_right(one.breaks, n), lambda t, i: one.pieces[i](t))
        delay = self.continuous[name]
        past = t - delay.tau(t)
        nudged = past + NUDGE * (side - delay.tau(side) - past)

        def read(past: Value, index: int) -> Value:
            return self.values(past, index)[delay.source] if index >= 0 else delay.before + 0.0 * past

        return _by_group(past, nudged, lambda n: bisect_right(self.starts, n) - 1, read)

    def values(self, t: Value, index: int) -> Values:
        """All signals at t on the solved stretch `index`."""
        stretch = self.stretches[index]
        known = dict(zip(self.system.states, stretch.solution(t), strict=True)) | dict(stretch.held)
        return Values(self, t, (stretch.start + stretch.end) / 2, known)

    def columns(self, times: Array, names: Sequence[str]) -> dict[str, Array]:
        """Signals at the instants `times`; at a breakpoint as they are just after it."""
        found = {name: np.empty(len(times)) for name in names}
        indices = np.searchsorted(self.starts, times + SAME_TIME, side="right") - 1
        for index in np.unique(indices):
            rows = np.flatnonzero(indices == index)
            values = self.values(times[rows], int(index))
            for name in names:
                found[name][rows] = values[name]
        return found

    def _announce(self, kind: str, moment: float, what: Any) -> None:
        heapq.heappush(self.queue, (moment, next(self.number), kind, what))

    def _next(self, now: float, duration: float) -> float:
        """End of the smooth interval that starts now."""
        limits = [_arrival(delay.tau, now) for delay in self.continuous.values()]
        return min([duration, *limits, *(moment for moment, *_ in self.queue[:1])])

    def _due(self, now: float) -> Iterator[tuple[str, Any]]:
        while self.queue and self.queue[0][0] < now + SAME_TIME:
            yield self.queue[0][2], heapq.heappop(self.queue)[3]

    def _events(self, now: float) -> None:
        """Arrivals first, then samplers in their order, then the kinks that set out from here."""
        order, ticking = SMOOTH + 1, {}
        for kind, what in list(self._due(now)):
            order = min(order, what if kind == "kink" else 0)
            if kind == "arrival":
                self._hold(now, *what)
            elif kind == "tick":
                ticking[what[0].output] = what[1]
        for sampler in self.system.samplers:
            if sampler.output in ticking:
                step = ticking[sampler.output] + 1
                self._announce("tick", step * sampler.period, (sampler, step))
                known = dict(zip(self.system.states, self.state, strict=True)) | self.held
                self._hold(now, sampler.output, sampler.update(Values(self, now, now + JUST_AFTER, known)))
        for delay in self.continuous.values():
            if order + delay.smoothing <= SMOOTH:
                self._announce("kink", _arrival(delay.tau, now), order + delay.smoothing)

    def _hold(self, now: float, name: str, value: float) -> None:
        """A held signal takes a new value, which will arrive behind each of its delays."""
        self.held[name] = float(value)
        for output, delay in self.system.delays.items():
            if delay.held and delay.source == name:
                self._announce("arrival", _arrival(delay.tau, now), (output, float(value)))

    def _solve(self, now: float, end: float) -> float:
        slope = self._field((now + end) / 2)
        for start, stop, solution in self.integrator(slope, now, end, self.state, self.full):
            self._keep(start, stop, solution)
        self.state = np.array(self.stretches[-1].solution(end), dtype=float)
        self.full = np.maximum(self.full, np.abs(self.state))
        return end

    def _field(self, side: float) -> Field:
        names, held = tuple(self.system.states), dict(self.held)
        timed = [*self.system.inputs, *self.continuous]

        def at(t: Value) -> Callable[[Array], Array]:
            known = {name: self.given(name, t, side) for name in timed} | held

            def rates(x: Array) -> Array:
                values = Values(self, t, side, known)
                values.update(zip(names, x, strict=True))
                found = self.system.rates(values)
                return np.array(np.broadcast_arrays(*found, x[0])[:-1] if np.ndim(t) else found, dtype=float)

            return rates

        return at

    def _keep(self, start: float, end: float, solution: Solution) -> None:
        self.starts.append(start)
        self.stretches.append(Stretch(start, end, dict(self.held), solution))


def simulate(
    system: System,
    duration: float,
    columns: Sequence[str],
    *,
    integrator: Integrator = collocation,
    frame: float = 1e-3,
) -> dict[str, Array]:
    """Record with rows at 0, frame, 2 frame, ... duration: `time` and the named columns."""
    times = np.arange(round(duration / frame) + 1) * frame
    run = Run(system, integrator).to(float(times[-1]))
    return {"time": times} | run.columns(times, columns)


def _arrival(tau: Callable[[float], float], moment: float) -> float:
    """The instant t at which what left at `moment` arrives: t - tau(t) = moment."""
    guess = moment + tau(moment)
    if tau(guess) == tau(moment):
        return guess
    late = guess
    while late - tau(late) <= moment:
        late += tau(moment)
    return float(brentq(lambda t: t - tau(t) - moment, moment, late, xtol=1e-15, rtol=1e-15))


def _by_group(
    t: Value, nudged: Value, group: Callable[[float], int], read: Callable[[Value, int], Value]
) -> Value:
    """Read each instant of t on the smooth piece to which its nudged copy belongs."""
    if np.ndim(t) == 0:
        return read(t, group(nudged))
    first, last = group(float(np.min(nudged))), group(float(np.max(nudged)))
    if first == last:
        return np.broadcast_to(read(t, first), np.shape(t))
    groups = np.array([group(n) for n in nudged])
    found = np.empty(len(t))
    for index in np.unique(groups):
        found[groups == index] = read(t[groups == index], int(index))
    return found


def _constant(x: Array, t: Value) -> Array:
    return np.repeat(x[:, None], len(t), axis=1) if np.ndim(t) else x
