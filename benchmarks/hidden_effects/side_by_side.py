"""A diagnosis in one process that ends where it would in several on a machine that does nothing else.

A budget is in seconds of a user's clock, for processes side by side. A benchmark has better use for the other cores: it
runs one process per case, on a clock of its own that counts this process's work, goes back to the beginning of a round
of segments for each lane in which another process would work, and stands at the end of the longest lane when the round
is over. What else the machine does changes hardly an answer: the same work takes somewhat more of the processor's time
beside other work. Not counted: starting processes and sending them tasks.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch


class Lanes:
    """A clock for work that is done one after the other and counted as side by side."""

    def __init__(self, processes: int) -> None:
        self.processes = processes
        self._saved = 0.0

    def monotonic(self) -> float:
        """s, as `time.monotonic` where this is what `time` means."""
        return time.process_time() - self._saved

    def share(self, work: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """(place, result) of every task, in the order in which they would be done."""
        free = [self.monotonic()] * self.processes
        done = []
        for place, task in enumerate(tasks):
            lane = free.index(min(free))
            self._set(free[lane])
            result = work(task)
            free[lane] = self.monotonic()
            done.append((free[lane], place, result))
        self._set(max(free))
        for _, place, result in sorted(done, key=lambda one: one[:2]):
            yield place, result

    def _set(self, now: float) -> None:
        self._saved = time.process_time() - now


@contextmanager
def side_by_side(processes: int) -> Iterator[Lanes]:
    """Diagnoses in here run in this process, on the clock of so many."""
    lanes = Lanes(processes)

    @contextmanager
    def workers(_: int) -> Iterator[Any]:
        yield lanes.share

    with (
        patch("delaytools.diagnosis.case.time", lanes),
        patch("delaytools.diagnosis.diagnose.time", lanes),
        patch("delaytools.diagnosis.diagnose.workers", workers),
    ):
        yield lanes
