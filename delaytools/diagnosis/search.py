"""Forward, swap and backward: which effects a segment needs, each re-fitted with everything else that is free."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added, places_in_file
from delaytools.diagnosis.attempts import MORE, QUICK, attempt, best_of_each, cost, fits, rubs_beside
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.driving import nominal
from delaytools.diagnosis.fitting import STEPS, TOLERANCE, Fitted, fit_hypothesis
from delaytools.diagnosis.lattices import ahead_of_lattice, quantisers_shown
from delaytools.diagnosis.noise_of import CLEANED, Carried, is_loud, noise_of
from delaytools.diagnosis.nuisance import with_nuisance_of
from delaytools.diagnosis.pairs import pairs
from delaytools.diagnosis.proposals import PENALTY, is_sharpened, proposals, sharpened_again
from delaytools.diagnosis.screen import base_of
from delaytools.diagnosis.stepwise import with_draws
from delaytools.diagnosis.upgrades import plainer, richer
from delaytools.diagnosis.worth import NAMED, PART_OF_NOISE, objection
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["Finding", "most_of", "search"]

Array = NDArray[np.float64]
MOST, MOST_IN_PIECES = 3, 2  # effects of a segment; in real runs a third one takes what no catalogue holds
FINEST, RESOLVED = 8, 2.0  # times finer than usual steps at most, and χ² that half the step may still change
CLEARER = 2  # times that edges, steps and periods are sought again through the noise that they leave
REFITTED, OTHERS = 4, 2  # candidates fitted again when the noise is known better, and more of other kinds
NEAR, FARTHEST = 0.3, 400.0  # of the best one's χ², and χ²: how much worse they may be
NEAREST, WORTH_MORE = 3, 0.1  # hypotheses whose richer forms are tried, and what these must take off, of their χ²
AS_GOOD = 1.0  # χ² by which two places of one effect are as good
CLOSE = 60.0  # χ²: a hypothesis worse by more is not fitted to the end, since nothing would make it as good
BEGINNINGS = 2  # other effects with which a search may begin again


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

    begin: one effect to begin with (default: the one that takes most off).
    """
    case = replace(_seen(case, nominal(case), carried), deadline=deadline)
    if case.residual(case.outputs((), nominal(case).values)).std() > 1e-2:
        case = with_draws(case)
    null = fit_hypothesis(case, ())
    case, null = _rewhitened(case, null, carried)
    fitted, refused = null, None
    rivals: list[list[Fitted]] = []
    beginnings: tuple[Fitted, ...] = ()
    while len(fitted.added) < most_of(case) and _left(case, fitted) > NAMED + PENALTY and not case.is_late:
        if begin is not None and not fitted.added:
            (best, others, seen), further = _only(case, begin, carried), ()
        else:
            best, others, seen, further = _step(case, fitted, carried)
        if best is None:
            break
        beginnings = beginnings if fitted.added else further
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
    case, fitted, rivals = _swapped(case, fitted, rivals, carried, everything=begin is not None)
    case, fitted, rivals = _pruned(case, fitted, rivals, carried)
    for one in quantisers_shown(case, fitted, PART_OF_NOISE):
        case, fitted = _rewhitened(case, replace(fitted, added=(*fitted.added, one)), carried)
        rivals.append([])
    rivals = [_beside_the_rest(case, fitted, place, group) for place, group in enumerate(rivals)]
    null = fit_hypothesis(case, (), near=null)
    sent = carried.through(case, fitted, share=CLEANED)
    return Finding(case, null, fitted, tuple(map(tuple, rivals)), refused, sent, case.is_late, beginnings)


def most_of(case: Case) -> int:
    """Effects that one segment may be given."""
    return MOST_IN_PIECES if case.pieces else MOST


def _seen(case: Case, fitted: Fitted, carried: Carried) -> Case:
    """The case through the noise that a hypothesis leaves, beside what uncertain values of other segments do by it."""
    return with_nuisance_of(case.whitened_by(noise_of(case, fitted, carried)), fitted)


def _rewhitened(case: Case, fitted: Fitted, carried: Carried) -> tuple[Case, Fitted]:
    """The case seen through the noise that this hypothesis leaves, and the hypothesis fitted again."""
    case = _seen(case, fitted, carried)
    return case, fit_hypothesis(case, fitted.added, near=fitted)


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
            case, fitted = _rewhitened(case, fit_hypothesis(case, back, near=again), carried)
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
    first, *rest = _again(case, [best, *others], best)
    return case, first, rest


def _refused(case: Case, fitted: Fitted, best: Fitted, carried: Carried) -> str:
    """Why the last effect of the best hypothesis is not to be named beside what was found; "" where it is."""
    before = _refit(case, fitted)
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
    left = [m - y for m, y in zip(case.measured, outputs, strict=True)]
    return any(
        is_loud(case, j, np.concatenate([rows[:, j] for rows in left]), float(np.std(sent[j])))
        for j in range(len(case.exits))
    )


def _first_of_kinds(tried: list[Fitted], without: set[str], most: int) -> list[Fitted]:
    """Of these, cheapest first, the first one of every kind of last effect, other kinds than these alone."""
    found = {one.added[-1].kind.partition(":")[0]: one for one in reversed(tried) if one.added}
    return sorted((one for kind, one in found.items() if kind not in without), key=cost)[:most]


def _only(case: Case, begin: Fitted, carried: Carried) -> tuple[Fitted | None, list[Fitted], Case]:
    """As `_step`, with nothing but this hypothesis."""
    seen, again = _seen_through_the_best(case, case, [begin], carried)
    return (again[0] if again else None), [], seen


def _step(
    case: Case, fitted: Fitted, carried: Carried
) -> tuple[Fitted | None, list[Fitted], Case, tuple[Fitted, ...]]:
    """The hypothesis with the best effect more, its rivals, the case seen through the noise that it leaves, and the
    best ones with one effect more of other kinds that are worth it."""
    rough, base = case, fitted
    if case.pieces or _is_loud(case, fitted, carried):
        rough = case.roughly()
        base = _refit(rough, fitted) or fitted
    found = sorted(proposals(rough, base), key=lambda one: not rubs_beside(base, one.added))
    more = richer(rough, base, least=0.5 * max((one.gain for one in found), default=0.0))
    ordered = [((*base.added, ahead_of_lattice(rough, base, one.added)), one.gain) for one in found]
    tried = fits(rough, base, [*((added, np.inf) for added in more), *ordered])
    if not tried:
        return None, [], case, ()
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
    if most == len(base.added) + 2 and any(_spared(seen, again[0], most - k, carried) for k in (1, 2)):
        plainest = [one for one in tried if len(one.added) < most]
        seen, again = _seen_through_the_best(case, rough, plainest, carried)
    worth = [t for t in tried if len(t.added) == len(base.added) + 1 and cost(t) < base.chi2 - NAMED]
    others = _first_of_kinds(worth, {one.kind.partition(":")[0] for one in again[0].added}, BEGINNINGS)
    return again[0], again[1:], seen, tuple(others)


def _seen_through_the_best(
    case: Case, rough: Case, tried: list[Fitted], carried: Carried
) -> tuple[Case, list[Fitted]]:
    """The case seen through the noise that the best of these leaves, and they fitted again, cheapest first."""
    best = sharpened_again(rough, tried[0])
    seen = _seen(case, best, carried)
    for _ in range(CLEARER if is_sharpened(best) else 0):  # what is left of a wrong edge is no noise
        best = sharpened_again(seen, _refit(seen, best) or best)
        seen = _seen(case, best, carried)
    return seen, _shown_first(seen, _again(seen, [best, *tried[1:]], best))


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
    """The hypothesis with its last effect ahead of the others at its port; None where it stands there alone."""
    *rest, last = fitted.added
    least = min((one.rank for one in rest if one.at == last.at), default=None)
    return None if least is None else (*rest, replace(last, rank=least - 1))


def _again(case: Case, tried: list[Fitted], best: Fitted) -> list[Fitted]:
    """Hypotheses that may be as good as the best, cheapest first: fitted again roughly, the nearest to the end."""
    if case.is_late:
        return [one for one in (_refit(case, best),) if one is not None]
    near = _of_every_kind([
        t for k, t in enumerate(tried)
        if cost(t) < cost(best) + max((NEAR if k < 3 else 0.0) * best.chi2, FARTHEST)
    ])  # fmt: skip
    rough = [f for t in near if (f := _refit(case, t, tolerance=QUICK, evaluations=MORE)) is not None]
    least = min(map(cost, rough), default=np.inf)
    ends = [_refit(case, one) if cost(one) < least + CLOSE else one for one in rough]
    return sorted((one for one in ends if one is not None), key=cost)


def _of_every_kind(tried: list[Fitted]) -> list[Fitted]:
    """The first few of these, and the first of other kinds: one kind at many places or from many sources would else
    leave no room for another that is as good."""
    first = tried[:REFITTED]
    known = {one.added[-1].kind.partition(":")[0] for one in first if one.added}
    return [*first, *_first_of_kinds(tried[REFITTED:], known, OTHERS)]


def _refit(
    case: Case, fitted: Fitted, *, tolerance: float = TOLERANCE, evaluations: int = STEPS
) -> Fitted | None:
    try:
        return fit_hypothesis(case, fitted.added, near=fitted, tolerance=tolerance, evaluations=evaluations)
    except (DelaytoolsError, np.linalg.LinAlgError, ValueError):
        return None


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
        found = [one for one in proposals(case, without)[:8] if one.added.key != here]
        hypotheses = [((*without.added, one.added), one.gain) for one in found]
        tried = fits(case, without, hypotheses, known=without.chi2 - fitted.chi2, further=True)
        held = {one.key: one.held for one in rest}
        tried = [replace(t, added=tuple(replace(a, held=held.get(a.key, a.held)) for a in t.added)) for t in tried]
        again = _again(case, tried, min(fitted, *tried, key=cost)) if tried else []
        again = [one for one in again if _keys(one) != _keys(fitted)]  # a late search hands it back
        if again and cost(again[0]) < cost(fitted) - 1.0:
            ordered = (*again[0].added[:place], again[0].added[-1], *again[0].added[place:-1])
            gone = fitted.added[place]
            case, fitted = _rewhitened(case, again[0], carried)
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
        without = _spared(case, fitted, place, carried)
        if without is None:
            place += 1
            continue
        case, fitted = _rewhitened(case, without, carried)
        rivals = [r for k, r in enumerate(rivals) if k != place]
        place = 0
    return case, fitted, rivals


def _spared(case: Case, fitted: Fitted, place: int, carried: Carried) -> Fitted | None:
    """The hypothesis without one of its effects, where that is not worth its values beside the others; else None."""
    rest = tuple(one for k, one in enumerate(fitted.added) if k != place)
    without = _refit(case, replace(fitted, added=rest))
    return without if without is not None and objection(case, without, fitted, carried, place) else None
