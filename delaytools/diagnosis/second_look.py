"""A search begun again with another effect, where what the first one found leaves something or may only imitate."""

import time
from dataclasses import replace

from delaytools.diagnosis.case import Case
from delaytools.diagnosis.leftover import imitated, unexplained
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.search import Finding, search

__all__ = ["searched"]

PART = 0.5  # of the time that is left: other segments wait


def searched(case: Case, carried: Carried, *, deadline: float) -> Finding:
    """What a search finds; where that explains the logs less than wholly, begun again with the next best effects.

    Of two effects the one that takes most off at first may be imitated: a delay that swings at the rate of a sine in
    the demand does what a stiffening spring does, and then whatever comes next makes up for it.
    """
    found = search(case, carried, deadline=deadline)
    now = time.monotonic()
    until = now + PART * (deadline - now)
    for begin in found.beginnings:
        if found.exhausted or _explains(found):
            break
        again = search(case, carried, deadline=until, begin=begin)
        if again.exhausted:
            return replace(found, exhausted=True)
        if _explains(again):
            return again
    return found


def _explains(found: Finding) -> bool:
    case, fitted = found.case, found.fitted
    return not (unexplained(case, fitted, found.sent) or imitated(case, fitted))
