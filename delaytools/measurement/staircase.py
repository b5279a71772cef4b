"""Which signals of a log are held: staircases whose steps keep to a common number of rows."""

from dataclasses import replace

import numpy as np

from delaytools.signals.record import Record

__all__ = ["with_staircases_held"]

FEWEST_STEPS = 10


def with_staircases_held(record: Record) -> tuple[Record, tuple[str, ...]]:
    """The record with every staircase marked as held, and what was found, in words.

    A staircase changes at least ten times, and only at rows that lie a common number (two or more) of rows apart.
    """
    found, words = set(record.held), []
    for name in record.names:
        steps = np.flatnonzero(np.diff(record[name])) + 1
        if name in found or len(steps) < FEWEST_STEPS:
            continue
        apart = int(np.gcd.reduce(np.diff(steps)))
        if apart >= 2:
            found.add(name)
            words.append(f"{name} changes only every {apart} rows: it is taken to be held between")
    return replace(record, held=frozenset(found)), tuple(words)
