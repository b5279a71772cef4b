"""Forward, swap and backward: which effects a segment needs, each re-fitted with everything else that is free."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.attempts import attempt, cost, fits
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.driving import nominal
from delaytools.diagnosis.fitting import STEPS, Fitted, fit_hypothesis
from delaytools.diagnosis.forward import Way, forward
from delaytools.diagnosis.lattices import quantisers_shown
from delaytools.diagnosis.leftover import explains
from delaytools.diagnosis.noise_of import CLEANED, Carried
from delaytools.diagnosis.proposals import proposals
from delaytools.diagnosis.refits import fitted_again, refitted, rewhitened, seen_through, spared
from delaytools.diagnosis.stepwise import with_draws
from delaytools.diagnosis.worth import PART_OF_NOISE, most_of

__all__ = ["Finding", "search"]

Array = NDArray[np.float64]
AHEAD = 2  # effects after which ways that began nearly as well are compared


@final
@dataclass(frozen=True, eq=False)
class Finding:
    """What a search found in one segment.

    case: with the filters of the last hypothesis. null, fitted: without and with the effects. rivals: per effect, other
    candidates fitted in its place. refused: the best effect more, and why it is not one. sent: per exit (n,), what
    noise left in cleaned inputs may do along the first log. beginnings: other effects that are worth it alone.
    """

    case: Case
    null: Fitted
    fitted: Fitted
    rivals: tuple[tuple[Fitted, ...], ...]
    refused: tuple[Added, str] | None
    sent: tuple[Array, ...]
    exhausted: bool
    beginnings: tuple[Fitted, ...] = ()


def search(case: Case, carried: Carried, *, deadline: float = np.inf, begin: Fitted | None = None) -> Finding:
    """The effects that the logs of a segment ask for; `carried`: what the inputs' noise sends to its exits.

    begin: one effect to begin with (default: the one that takes most off; where that leads to something left, another
    one that took nearly as much off).
    """
    case = replace(seen_through(case, nominal(case), carried), deadline=deadline)
    if case.residual(case.outputs((), nominal(case).values)).std() > 1e-2:
        case = with_draws(case)
    null = fit_hypothesis(case, ())
    case, null = rewhitened(case, null, carried)
    most, start = most_of(case), Way(case, null)
    way = forward(start, carried, most=min(AHEAD, most), begin=begin)
    if begin is None:
        others = (forward(start, carried, most=min(AHEAD, most), begin=one) for one in way.alike)
        way = forward(_best_way(way, others, carried), carried, most=most)
    return _finished(way, null, carried, everything=begin is not None)


def _best_way(way: Way, others: Iterable[Way], carried: Carried) -> Way:
    """Of ways that began nearly as well, the one that leaves least, as the first one sees it.

    Asked where the first needed a second effect or leaves something: what it holds may be imitated, by two even all.
    Not in real runs, where the model's error is always left.
    """
    if not way.alike or way.case.is_late or way.case.pieces:
        return way
    sent = carried.through(way.case, way.fitted, share=CLEANED)
    if len(way.fitted.added) < AHEAD and explains(way.case, way.fitted, sent):
        return way
    left = {cost(way.fitted): way}
    for other in others:
        rest = way.case.residual(way.case.outputs(other.fitted.added, other.fitted.values))
        left[cost(replace(other.fitted, residual=rest))] = other
    return left[min(left)]


def _finished(way: Way, null: Fitted, carried: Carried, *, everything: bool) -> Finding:
    """What a way has led to, every effect swapped and pruned, with what logs themselves show of quantisers."""
    case, fitted, rivals = way.case, way.fitted, [list(group) for group in way.rivals]
    case, fitted, rivals = _swapped(case, fitted, rivals, carried, everything=everything)
    case, fitted, rivals = _pruned(case, fitted, rivals, carried)
    if case.pieces and fitted.added:  # beginnings move with the values: a fit may end a little early
        fitted = refitted(case, fitted) or fitted
    for one in quantisers_shown(case, fitted, PART_OF_NOISE):
        case, fitted = rewhitened(case, replace(fitted, added=(*fitted.added, one)), carried)
        rivals.append([])
    rivals = [_beside_the_rest(case, fitted, place, group) for place, group in enumerate(rivals)]
    null = fit_hypothesis(case, (), near=null)
    sent = carried.through(case, fitted, share=CLEANED)
    groups = tuple(map(tuple, rivals))
    return Finding(case, null, fitted, groups, way.refused, sent, case.is_late, way.beginnings)


def _swapped(
    case: Case, fitted: Fitted, rivals: list[list[Fitted]], carried: Carried, *, everything: bool
) -> tuple[Case, Fitted, list[list[Fitted]]]:
    """Every effect taken out in turn and everything tried in its place; what fits better stays.

    In the last one's place everything was tried when it was added: again only in other company, or if said so.
    """
    known = {one.key for one in fitted.added[:-1]}
    for place in range(len(fitted.added)):
        last = place == len(fitted.added) - 1
        if case.is_late or (last and not everything and {one.key for one in fitted.added[:-1]} == known):
            break
        rest = tuple(one for k, one in enumerate(fitted.added) if k != place)
        without = attempt(case, tuple(one.as_smooth for one in rest), fitted, STEPS)
        if without is None:  # unstable without it: nothing else can be tried in its place
            continue
        here = fitted.added[place].key
        found = [one for one in proposals(case, without, instead=True)[:8] if one.added.key != here]
        hypotheses = [((*without.added, one.added), one.gain) for one in found]
        tried = fits(case, without, hypotheses, known=without.chi2 - fitted.chi2, further=True)
        held = {one.key: one.held for one in rest}
        tried = [replace(t, added=tuple(replace(a, held=held.get(a.key, a.held)) for a in t.added)) for t in tried]
        again = fitted_again(case, tried, min(fitted, *tried, key=cost)) if tried else []
        again = [one for one in again if _keys(one) != _keys(fitted)]  # a late search hands it back
        if again and cost(again[0]) < cost(fitted) - 1.0:
            ordered = (*again[0].added[:place], again[0].added[-1], *again[0].added[place:-1])
            gone = fitted.added[place]
            case, fitted = rewhitened(case, again[0], carried)
            fitted = fit_hypothesis(case, ordered, near=fitted)
            before = attempt(case, (*again[0].added[:-1], gone), fitted, STEPS)  # hardly worse, it may be
            again = [*again[1:], *([] if before is None else [before])]
        rivals[place] = again
    return case, fitted, rivals


def _beside_the_rest(case: Case, fitted: Fitted, place: int, rivals: list[Fitted]) -> list[Fitted]:
    """Rivals of the effect at a place with the other effects as they stand at the end."""
    others = (*fitted.added[:place], *fitted.added[place + 1 :])
    found = []
    for one in rivals:
        if _keys(one) == {*(a.key for a in others), one.added[-1].key}:
            found.append(one)
        elif not case.is_late and (again := attempt(case, (*others, one.added[-1]), fitted, STEPS)) is not None:
            found.append(again)
    return sorted(found, key=cost)


def _keys(fitted: Fitted) -> set[object]:
    return {one.key for one in fitted.added}


def _pruned(
    case: Case, fitted: Fitted, rivals: list[list[Fitted]], carried: Carried
) -> tuple[Case, Fitted, list[list[Fitted]]]:
    """Effects that are no longer worth their values are taken out again."""
    place = 0
    while place < len(fitted.added) and len(fitted.added) > 1:
        without = spared(case, fitted, place, carried)
        if without is None:
            place += 1
            continue
        case, fitted = rewhitened(case, without, carried)
        rivals = [r for k, r in enumerate(rivals) if k != place]
        place = 0
    return case, fitted, rivals
