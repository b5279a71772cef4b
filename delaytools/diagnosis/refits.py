"""Hypotheses fitted again: through the noise that another one leaves, and those that may be as good as the best."""

from dataclasses import replace

import numpy as np

from delaytools.diagnosis.attempts import MORE, QUICK, cost
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import STEPS, TOLERANCE, Fitted, fit_hypothesis
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.diagnosis.nuisance import with_nuisance_of
from delaytools.diagnosis.worth import objection
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["first_of_kinds", "fitted_again", "refitted", "rewhitened", "seen_through", "spared"]

REFITTED, OTHERS = 4, 2  # candidates fitted again when the noise is known better, and more of other kinds
NEAR, FARTHEST = 0.3, 400.0  # of the best one's χ², and χ²: how much worse they may be
CLOSE = 60.0  # χ²: a hypothesis worse by more is not fitted to the end, since nothing would make it as good


def seen_through(case: Case, fitted: Fitted, carried: Carried) -> Case:
    """The case through the noise that a hypothesis leaves, beside what uncertain values of other segments do by it."""
    return with_nuisance_of(case.whitened_by(noise_of(case, fitted, carried)), fitted)


def rewhitened(case: Case, fitted: Fitted, carried: Carried) -> tuple[Case, Fitted]:
    """The case seen through the noise that this hypothesis leaves, and the hypothesis fitted again."""
    case = seen_through(case, fitted, carried)
    return case, fit_hypothesis(case, fitted.added, near=fitted)


def refitted(
    case: Case, fitted: Fitted, *, tolerance: float = TOLERANCE, evaluations: int = STEPS
) -> Fitted | None:
    try:
        return fit_hypothesis(case, fitted.added, near=fitted, tolerance=tolerance, evaluations=evaluations)
    except (DelaytoolsError, np.linalg.LinAlgError, ValueError):
        return None


def fitted_again(case: Case, tried: list[Fitted], best: Fitted) -> list[Fitted]:
    """Hypotheses that may be as good as the best, cheapest first: fitted again roughly, the nearest to the end."""
    if case.is_late:
        return [one for one in (refitted(case, best),) if one is not None]
    near = _of_every_kind([
        t for k, t in enumerate(tried)
        if cost(t) < cost(best) + max((NEAR if k < 3 else 0.0) * best.chi2, FARTHEST)
    ])  # fmt: skip
    rough = [f for t in near if (f := refitted(case, t, tolerance=QUICK, evaluations=MORE)) is not None]
    least = min(map(cost, rough), default=np.inf)
    ends = [refitted(case, one) if cost(one) < least + CLOSE else one for one in rough]
    return sorted((one for one in ends if one is not None), key=cost)


def _of_every_kind(tried: list[Fitted]) -> list[Fitted]:
    """The first few of these, and the first of other kinds: one kind at many places or from many sources would else
    leave no room for another that is as good."""
    first = tried[:REFITTED]
    known = {one.added[-1].kind.partition(":")[0] for one in first if one.added}
    return [*first, *first_of_kinds(tried[REFITTED:], known, OTHERS)]


def first_of_kinds(tried: list[Fitted], without: set[str], most: int) -> list[Fitted]:
    """Of these, cheapest first, the first one of every kind of last effect, other kinds than these alone."""
    found = {one.added[-1].kind.partition(":")[0]: one for one in reversed(tried) if one.added}
    return sorted((one for kind, one in found.items() if kind not in without), key=cost)[:most]


def spared(case: Case, fitted: Fitted, place: int, carried: Carried) -> Fitted | None:
    """The hypothesis without one of its effects, where that is not worth its values beside the others; else None."""
    rest = tuple(one for k, one in enumerate(fitted.added) if k != place)
    without = refitted(case, replace(fitted, added=rest))
    return without if without is not None and objection(case, without, fitted, carried, place) else None
