"""Forward: effects found one after another, each with its rivals, until nothing more is worth its values."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from delaytools.diagnosis.added import Added, places_in_file
from delaytools.diagnosis.attempts import best_of_each, cost, fits, rubs_beside
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis, has_odd_rows
from delaytools.diagnosis.lattices import ahead_of_lattice
from delaytools.diagnosis.noise import without_odd_rows
from delaytools.diagnosis.noise_of import Carried, is_loud
from delaytools.diagnosis.pairs import pairs
from delaytools.diagnosis.proposals import PENALTY, is_sharpened, proposals, sharpened_again
from delaytools.diagnosis.refits import (
    NEAR,
    first_of_kinds,
    fitted_again,
    refitted,
    rewhitened,
    seen_through,
    spared,
)
from delaytools.diagnosis.screen import base_of
from delaytools.diagnosis.stepwise import with_draws
from delaytools.diagnosis.upgrades import plainer, richer
from delaytools.diagnosis.worth import NAMED, most_of, objection

__all__ = ["Way", "forward"]

FINEST, RESOLVED = 8, 2.0  # times finer than usual steps at most, and χ² that half the step may still change
CLEARER = 2  # times that edges, steps and periods are sought again through the noise that they leave
NEAREST, WORTH_MORE = 3, 0.1  # hypotheses whose richer forms are tried, and what these must take off, of their χ²
AS_GOOD = 1.0  # χ² by which two places of one effect are as good
BEGINNINGS = 2  # other effects with which a search may begin again
ALIKE = 0.1  # of the best one's χ²: an effect worse by less at first may be the one to begin with


@final
@dataclass(frozen=True, eq=False)
class Way:
    """Where effects found one after another have led.

    case: with the filters of the last hypothesis. fitted: with the effects. rivals: per effect, other candidates fitted
    in its place. refused: the best effect more, and why it is not one. beginnings: other effects that are worth it
    alone, best first; alike: of these, those that took nearly as much off as the one that was begun with. ended:
    whether nothing more is worth its values.
    """

    case: Case
    fitted: Fitted
    rivals: tuple[tuple[Fitted, ...], ...] = ()
    refused: tuple[Added, str] | None = None
    beginnings: tuple[Fitted, ...] = ()
    alike: tuple[Fitted, ...] = ()
    ended: bool = False


def forward(way: Way, carried: Carried, *, most: int, begin: Fitted | None = None) -> Way:
    """A way gone on, effect by effect, to so many at most; begun with one that is given or that takes most off."""
    case, fitted, refused = way.case, way.fitted, way.refused
    rivals = [list(group) for group in way.rivals]
    beginnings, alike, ended = way.beginnings, way.alike, way.ended
    while len(fitted.added) < most and not ended and not case.is_late:
        ended = True
        if _left(case, fitted) <= NAMED + PENALTY:
            break
        if begin is not None and not fitted.added:
            (best, others, seen), further = _only(case, begin, carried), _Others((), ())
        else:
            best, others, seen, further = _step(case, fitted, carried)
        if best is None:
            break
        if not fitted.added:
            beginnings, alike = further.worth, further.alike
        why, coarse = _refused(seen, fitted, best, carried), seen
        if not why:
            seen, best, others = _resolved(seen, best, others)
            why = "" if seen is coarse else _refused(seen, fitted, best, carried)
        if why:
            refused = best.added[-1], why
            break
        kept = [k for k, one in enumerate(fitted.added) if one.key in {b.key for b in best.added}]
        new = len(best.added) - len(kept)
        rivals = [*(rivals[k] for k in kept), *([] for _ in range(new - 1)), others]
        case, fitted = _windows_again(seen, best, carried)
        if all(one.kind != "dropped_frames" for one in fitted.added):
            drawn = with_draws(case, fitted)
            case = drawn if any(drawn.lost.values()) else case
        ended = False
    return Way(case, fitted, tuple(map(tuple, rivals)), refused, beginnings, alike, ended)


@final
@dataclass(frozen=True, eq=False)
class _Others:
    """Hypotheses with one effect more of another kind than the best: those that are worth it, those nearly as good."""

    worth: tuple[Fitted, ...]
    alike: tuple[Fitted, ...]


def _windows_again(case: Case, fitted: Fitted, carried: Carried) -> tuple[Case, Fitted]:
    """The hypothesis with the edges of earlier windows of gain sought again beside what was found since."""
    for place, one in enumerate(fitted.added[:-1]):
        if one.kind != "transient_gain" or case.pieces or case.is_late:
            continue
        along = places_in_file(fitted.added)
        ranked = tuple(replace(each, rank=along.index(k)) for k, each in enumerate(fitted.added))
        moved = (*ranked[:place], *ranked[place + 1 :], ranked[place])
        again = sharpened_again(case, fit_hypothesis(case, moved, near=fitted))
        if again.chi2 < fitted.chi2 - AS_GOOD:
            back = (*again.added[:place], again.added[-1], *again.added[place:-1])
            case, fitted = rewhitened(case, fit_hypothesis(case, back, near=again), carried)
    return case, fitted


def _resolved(case: Case, best: Fitted, others: list[Fitted]) -> tuple[Case, Fitted, list[Fitted]]:
    """The case with steps so fine that half of them would change the best one's residual by less than chance does.

    The error of a run may look like a further effect, above all where a stiff force drives what integrates.
    """
    coarse = case
    while case.finer < FINEST and not case.pieces and not case.is_late:
        finer = replace(case, finer=2 * case.finer, _replays={})
        runs = (one.outputs(best.added, best.values) for one in (finer, case))
        change = case.whitened(tuple(a - b for a, b in zip(*runs, strict=True)))
        if float(change @ change) < RESOLVED:
            break
        case = finer
    if case is coarse:
        return case, best, others
    first, *rest = fitted_again(case, [best, *others], best)
    return case, first, rest


def _refused(case: Case, fitted: Fitted, best: Fitted, carried: Carried) -> str:
    """Why the last effect of the best hypothesis is not to be named beside what was found; "" where it is."""
    before = refitted(case, fitted)
    return "" if before is None else objection(case, before, best, carried)


def _left(case: Case, fitted: Fitted) -> float:
    """χ² that an effect more could take off; far below the number of rows where a model meets what a log resolves."""
    return float(len(fitted.residual)) if case.pieces else fitted.chi2


def _is_loud(case: Case, fitted: Fitted, carried: Carried) -> bool:
    """Whether some exit's residual is far above the noise that its own differences and its inputs' noise show.

    What the loop does with its own noise goes with no outside signal. Where that is most of what an exit does, the
    filters of a hypothesis that is far from the truth take the truth for noise.
    """
    outputs, sent = case.outputs(fitted.added, fitted.values), carried.through(case, fitted)
    whole = np.concatenate([m - y for m, y in zip(case.measured, outputs, strict=True)])
    left = [without_odd_rows(rows) if has_odd_rows(case, fitted.added) else rows for rows in whole.T]
    return any(is_loud(case, j, rows, float(np.std(sent[j]))) for j, rows in enumerate(left))


def _only(case: Case, begin: Fitted, carried: Carried) -> tuple[Fitted | None, list[Fitted], Case]:
    """As `_step`, with nothing but this hypothesis."""
    seen, again = _seen_through_the_best(case, case, [begin], carried)
    return (again[0] if again else None), [], seen


def _step(
    case: Case, fitted: Fitted, carried: Carried
) -> tuple[Fitted | None, list[Fitted], Case, _Others]:
    """The hypothesis with the best effect more, its rivals, the case seen through the noise that it leaves, and the
    best ones with one effect more of other kinds."""
    rough, base = case, fitted
    if case.pieces or _is_loud(case, fitted, carried):
        rough = case.roughly()
        base = refitted(rough, fitted) or fitted
    found = sorted(proposals(rough, base), key=lambda one: not rubs_beside(base, one.added))
    more = richer(rough, base, least=0.5 * max((one.gain for one in found), default=0.0))
    ordered = [((*base.added, ahead_of_lattice(rough, base, one.added)), one.gain) for one in found]
    tried = fits(rough, base, [*((added, np.inf) for added in more), *ordered])
    if not tried:
        return None, [], case, _Others((), ())
    further = [
        (added, np.inf) for one in tried[:NEAREST] if cost(one) < (1 + NEAR) * cost(tried[0])
        for added in richer(rough, one, least=WORTH_MORE * one.chi2)
    ]  # fmt: skip
    if len(base.added) + 2 <= most_of(case):
        two = pairs(base_of(rough, base), found, least=base.chi2 - tried[0].chi2)
        further += [((*base.added, *both), gain) for both, gain in two]
    tried = sorted([*tried, *fits(rough, base, further, further=True)], key=cost)
    other = [(added, np.inf) for one in tried[:NEAREST] for added in (plainer(one), _ahead(one)) if added is not None]
    changed = fits(rough, base, other, further=True)
    swung = [(a, np.inf) for one in changed for a in richer(rough, one, least=WORTH_MORE * one.chi2)]
    tried = sorted(best_of_each([*tried, *changed, *fits(rough, base, swung, further=True)]), key=cost)
    seen, again = _seen_through_the_best(case, rough, tried, carried)
    most = len(again[0].added)
    if most == len(base.added) + 2 and any(spared(seen, again[0], most - k, carried) for k in (1, 2)):
        plainest = [one for one in tried if len(one.added) < most]
        seen, again = _seen_through_the_best(case, rough, plainest, carried)
    worth = [t for t in tried if len(t.added) == len(base.added) + 1 and cost(t) < base.chi2 - NAMED]
    others = first_of_kinds(worth, {one.kind.partition(":")[0] for one in again[0].added}, BEGINNINGS)
    alike = tuple(one for one in others if cost(one) < (1 + ALIKE) * cost(tried[0]))
    return again[0], again[1:], seen, _Others(tuple(others), alike)


def _seen_through_the_best(
    case: Case, rough: Case, tried: list[Fitted], carried: Carried
) -> tuple[Case, list[Fitted]]:
    """The case seen through the noise that the best of these leaves, and they fitted again, cheapest first."""
    best = sharpened_again(rough, tried[0])
    seen = seen_through(case, best, carried)
    for _ in range(CLEARER if is_sharpened(best) else 0):  # what is left of a wrong edge is no noise
        best = sharpened_again(seen, refitted(seen, best) or best)
        seen = seen_through(case, best, carried)
    return seen, _shown_first(seen, fitted_again(seen, [best, *tried[1:]], best))


def _shown_first(case: Case, tried: list[Fitted]) -> list[Fitted]:
    """Hypotheses, cheapest first, but before all one that differs from the cheapest in nothing but the place of its
    last effect, which is nearer to what is measured: behind a gain an offset is another one at every port, and each is
    as good."""
    best, far = tried[0], [case.segment.ahead_of_exit(one.added[-1].at) for one in tried]
    nearest = 0
    for place, one in enumerate(tried):
        rest, last = [a.key for a in one.added[:-1]], one.added[-1]
        alike = rest == [a.key for a in best.added[:-1]] and last.kind == best.added[-1].kind
        if alike and far[place] < far[nearest] and cost(one) < cost(best) + AS_GOOD:
            nearest = place
    return [tried[nearest], *tried[:nearest], *tried[nearest + 1 :]]


def _ahead(fitted: Fitted) -> tuple[Added, ...] | None:
    """The hypothesis with its last effect ahead of the others at its port; None where it stands there alone, or where
    they add up: forces on a derivative have no order."""
    *rest, last = fitted.added
    if last.at.endswith("'"):
        return None
    least = min((one.rank for one in rest if one.at == last.at), default=None)
    return None if least is None else (*rest, replace(last, rank=least - 1))
