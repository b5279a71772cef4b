"""A signal over one chunk of fine steps, for many cases (lanes) at once.

A signal is a broken line: step j runs from `a[j]` (just after its start) to `b[j]` (just before its end), and may
jump between steps. `at` are its values at instants: the starts of the steps of a *leading* signal (written by a
sampled block, known before the chunk is run), the ends of the steps of every other one. Arrays are time x lanes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

Array = np.ndarray


class Wave(NamedTuple):
    """Values at instants, and the two ends of every step."""

    at: Array
    a: Array
    b: Array

    def take(self, lanes: Array) -> "Wave":
        """The wave of some lanes."""
        return Wave(self.at[:, lanes], self.a[:, lanes], self.b[:, lanes])

    def put(self, lanes: Array, part: "Wave") -> None:
        """Write the wave of some lanes in place."""
        self.at[:, lanes] = part.at
        self.a[:, lanes] = part.a
        self.b[:, lanes] = part.b

    def copy(self) -> "Wave":
        """A wave that may be written to."""
        return Wave(self.at.copy(), self.a.copy(), self.b.copy())

    def map(self, formula: Callable[[Array], Array]) -> "Wave":
        """The same formula at every point."""
        return Wave(formula(self.at), formula(self.a), formula(self.b))

    def plus(self, other: "Wave", factor: Array | float = 1.0) -> "Wave":
        """self + factor other."""
        return Wave(self.at + factor * other.at, self.a + factor * other.a, self.b + factor * other.b)


@dataclass(frozen=True)
class Clock:
    """The chunk: `count` steps of `step` seconds from fine step `first`; count 0 is the single instant t = 0."""

    first: int
    count: int
    step: float

    @property
    def starts(self) -> Array:
        """Start of every step, s, as a column."""
        return ((self.first + np.arange(self.count)) * self.step)[:, None]

    @property
    def ends(self) -> Array:
        """End of every step, s, as a column."""
        return ((self.first + 1 + np.arange(self.count)) * self.step)[:, None]

    def instants(self, leading: bool) -> Array:
        """Times of the values `at`."""
        if self.count == 0:
            return np.zeros((1, 1))
        return self.starts if leading else self.ends

    def instant_numbers(self, leading: bool) -> Array:
        """Fine-step numbers of the values `at`."""
        if self.count == 0:
            return np.zeros(1, dtype=int)
        return self.first + np.arange(self.count) + (0 if leading else 1)


def held(value: Array, count: int) -> Wave:
    """A value that stays over the chunk."""
    line = np.repeat(value[None, :], count, axis=0)
    return Wave(line, line.copy(), line.copy())
