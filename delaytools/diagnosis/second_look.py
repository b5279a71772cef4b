"""A search begun again with another effect, where what the first one found leaves something or may only imitate."""

from delaytools.diagnosis.case import Case
from delaytools.diagnosis.leftover import explains
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.search import Finding, search

__all__ = ["begun_again"]


def begun_again(found: Finding, case: Case, carried: Carried, *, deadline: float) -> Finding:
    """What a search found; where that explains the logs less than wholly, begun again with the next best effects.

    Of two effects the one that takes most off at first may be imitated: an interference is nearly a mode, and beside
    the mode the play that is there as well comes to nothing. Not in real runs, where the model's error is always left.
    """
    if case.pieces or found.exhausted or not found.beginnings or _explained(found):
        return found
    for begin in found.beginnings:
        again = search(case, carried, deadline=deadline, begin=begin)
        if again.exhausted:
            break
        if _explained(again):
            return again
    return found



def _explained(found: Finding) -> bool:
    return explains(found.case, found.fitted, found.sent)
