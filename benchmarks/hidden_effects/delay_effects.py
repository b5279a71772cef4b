"""Constant and varying delay of a broken line: looked up exactly, with the right mean over every step.

Where a jump arrives inside a step, the two ends of the step are moved so that its mean is right.
"""

from collections.abc import Mapping

import numpy as np

from benchmarks.hidden_effects.wave import Clock, Wave

Array = np.ndarray
LONGEST = 0.1  # s
NEARLY = 1e-7  # of a step


class Delay:
    """y(t) = x(t - delay(t)); before t = 0 a continuous signal has its first value, a sampled one is 0."""

    def __init__(self, name: str, values: Mapping[str, Array]) -> None:
        self.values = values
        self.past: list[Array] | None = None
        self.before: Array | None = None
        self.area: Array | None = None

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect."""
        if self.before is None:
            self.before = np.zeros_like(x.at[0]) if self._from_sampled(clock) else np.array(x.at[0])
        if clock.count == 0:
            return x
        self._remember(x, clock)
        starts, ends = clock.starts, clock.ends
        low, high = starts - self._delay(starts), ends - self._delay(ends)
        a, b = self._look(low, clock, after=True), self._look(high, clock, after=False)
        mean = (self._integral(high, clock) - self._integral(low, clock)) / (high - low)
        shift = mean - 0.5 * (a + b)
        instants = clock.instants(leading)
        return Wave(self._instants(x, instants, clock), a + shift, b + shift)

    def _from_sampled(self, clock: Clock) -> bool:
        return clock.count > 0

    def _instants(self, x: Wave, t: Array, clock: Clock) -> Array:
        return self._look(t - self._delay(t), clock, after=True)

    def _delay(self, t: Array) -> Array:
        p = self.values
        if "mean" not in p:
            return np.broadcast_to(p["delay"], (len(t), len(p["delay"])))
        return p["mean"] + p["amplitude"] * np.sin(2 * np.pi * p["frequency"] * t + p["phase"])

    def _remember(self, x: Wave, clock: Clock) -> None:
        """Keep the last steps: their two ends, and the integral up to their start."""
        keep = int(np.ceil(LONGEST / clock.step)) + clock.count
        if self.past is None:
            line = np.repeat(self.before[None], keep, axis=0)
            area = np.arange(-keep, 0)[:, None] * clock.step * self.before
            self.past = [line, line.copy(), area]
            self.area = np.zeros_like(self.before)
        means = 0.5 * (x.a + x.b) * clock.step
        area = self.area + np.concatenate([np.zeros_like(means[:1]), np.cumsum(means, axis=0)])
        self.area = area[-1]
        for kept, new in zip(self.past, (x.a, x.b, area[:-1]), strict=True):
            kept[: -clock.count] = kept[clock.count :].copy()
            kept[-clock.count :] = new

    def _find(self, t: Array, clock: Clock, after: bool) -> tuple[Array, Array, Array]:
        """Row in the memory and the share of the step that has passed."""
        place = t / clock.step - (clock.first + clock.count - len(self.past[0]))
        row = np.floor(place + NEARLY) if after else np.ceil(place - NEARLY) - 1
        row = np.clip(row, 0, len(self.past[0]) - 1).astype(int)
        return row, np.arange(t.shape[1])[None, :], np.clip(place - row, 0.0, 1.0)

    def _look(self, t: Array, clock: Clock, after: bool) -> Array:
        row, lane, share = self._find(t, clock, after)
        a, b = self.past[0][row, lane], self.past[1][row, lane]
        return a + share * (b - a)

    def _integral(self, t: Array, clock: Clock) -> Array:
        row, lane, share = self._find(t, clock, True)
        a, b, area = (kept[row, lane] for kept in self.past)
        return area + clock.step * (share * a + 0.5 * share**2 * (b - a))
