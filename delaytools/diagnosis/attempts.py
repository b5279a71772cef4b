"""Hypotheses fitted roughly, to rank them: which are worth a fit, where their fits begin, how far these go."""

import numpy as np

from delaytools.diagnosis.added import Added, by_itself
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, at_values, fit_hypothesis
from delaytools.diagnosis.joint_start import making_room
from delaytools.diagnosis.proposals import PENALTY
from delaytools.diagnosis.pushes import along_measured
from delaytools.diagnosis.screen import base_of
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["MORE", "QUICK", "attempt", "best_of_each", "cost", "fits", "rubs_beside"]

QUICK = 1e-4
FEW, MORE = 4, 10  # runs of a first fit that only ranks, and of one that is worth going on with
HALF = 0.5  # of what the best took off: what took off less after a few runs is left
ALWAYS, PROMISING = 4, 0.6  # candidates fitted in any case; others where they promise this part of what was found
IN_PIECES = 0.3  # that part in real runs: far from the truth other values go far with an effect, unlike any profile
FRICTIONS = ("coulomb_friction", "stribeck_friction", "load_dependent_friction")
GENTLY, LOCKS = 0.1, 1.0  # of what a friction promises beside another; coefficient at which a load is held for good
FAR = 0.3  # of a design's value: where a fit has moved one further, it may stand in for the effect that is missing


def fits(
    case: Case,
    fitted: Fitted,
    hypotheses: list[tuple[tuple[Added, ...], float]],
    *,
    known: float = 0.0,
    further: bool = False,
) -> list[Fitted]:
    """Each hypothesis fitted, with the χ² that it promised; those that promise far less than was found are left out,
    or than the best promise: far from the truth all promises may be too low. A mode that comes out dull is none.

    known: χ² that something else is known to take off. further: beside others. After the deadline none, but a first one
    where there is no effect yet: a single run of a stiff friction may take seconds.
    """
    if case.is_late and (further or fitted.added):
        return []
    starts = _starts(case, fitted)
    best = max((promised for _, promised in hypotheses), default=0.0)
    part = IN_PIECES if case.pieces else PROMISING
    tried: list[Fitted] = []
    for place, (added, promised) in enumerate(hypotheses):
        if case.is_late and tried:
            break
        found = max((fitted.chi2 - one.chi2 for one in tried), default=0.0)
        if place < ALWAYS or promised >= part * min(found, best):
            tried += _begun(case, fitted, added, starts, promised)
            if case.pieces or not np.isfinite(promised):
                continue
            if all(fitted.chi2 - f.chi2 < HALF * promised for f in tried if f.added[-1].key == added[-1].key):
                tried += _along_measured(case, fitted, added)
    found = max((fitted.chi2 - one.chi2 for one in tried), default=0.0)
    for place, one in enumerate(tried):
        promised = fitted.chi2 - one.chi2 + one.falling
        if not one.is_settled and promised >= HALF * max(found, known) and not case.is_late:
            tried[place] = attempt(case, one.added, one, MORE) or one
    return sorted((one for one in best_of_each(tried) if not one.added[-1].is_dull), key=cost)


def _begun(
    case: Case, fitted: Fitted, added: tuple[Added, ...], starts: tuple[Fitted | None, ...], promised: float
) -> list[Fitted]:
    """A first few runs of a fit from every start.

    A friction that promises something beside another one begins small and as smooth as that, and where the other one
    gives way to it: at all that it promises both hold the mass, and a friction of more than its load locks it.
    """
    one, room = added[-1], None
    if rubs_beside(fitted, one):
        locks = "load" not in one.fixed and one.values.get("coefficient", 0.0) > LOCKS
        room = None if locks else making_room(base_of(case, fitted), one)
        other = next((k for k in added[:-1] if k.kind in FRICTIONS and k.at == one.at), None)
        if other is not None and np.isfinite(promised):
            small = {name: GENTLY * one.values[name] for name in ("level", "coefficient") if name in one.values}
            added = (*added[:-1], one.moved({**small, "smoothing": other.values["smoothing"]}))
    tried = [attempt(case, added, near, FEW) for near in starts]
    tried += [attempt(case, *room, FEW)] if room is not None and not case.is_late else []
    return [one for one in tried if one is not None]


def _along_measured(case: Case, fitted: Fitted, added: tuple[Added, ...]) -> list[Fitted]:
    """The hypothesis with its last effect along the measured motion, where a run by itself runs away at the values
    that this gives: else by itself, begun there."""
    one = along_measured(case, added[:-1], added[-1])
    driven = attempt(case, (*added[:-1], one), fitted, FEW) if one is not None else None
    if driven is None:
        return []
    alone = by_itself(driven.added)
    try:
        runs_away = not at_values(case, alone, driven).chi2 < fitted.chi2
    except DelaytoolsError:
        runs_away = True
    if runs_away:
        return [driven]
    free = attempt(case, alone, driven, MORE)
    return [free] if free is not None else []


def attempt(case: Case, added: tuple[Added, ...], near: Fitted | None, evaluations: int) -> Fitted | None:
    """A rough fit; None where it fails."""
    try:
        return fit_hypothesis(case, added, near=near, tolerance=QUICK, evaluations=evaluations)
    except (DelaytoolsError, np.linalg.LinAlgError, ValueError):
        return None


def _starts(case: Case, fitted: Fitted) -> tuple[Fitted | None, ...]:
    """Where fits begin: at the fitted values, and at the design's (None) where these have been left far behind."""
    known = fitted.by_path
    far = any(abs(known[p.path].value - p.value) > FAR * abs(p.value) for p in case.tolerated if p.path in known)
    return (fitted, None) if far and not fitted.added else (fitted,)


def best_of_each(tried: list[Fitted]) -> list[Fitted]:
    """The best fit of each hypothesis."""
    best: dict[object, Fitted] = {}
    for one in tried:
        key = tuple(sorted(str(added.key) for added in one.added))
        if np.isfinite(one.chi2) and (key not in best or one.chi2 < best[key].chi2):
            best[key] = one
    return list(best.values())


def rubs_beside(fitted: Fitted, one: Added) -> bool:
    """Whether an effect is another friction where there is one: fitted alone, one takes the other's place.

    What is then left promises little for the other, since the first must give way.
    """
    return one.kind in FRICTIONS and any(k.kind in FRICTIONS and k.at == one.at for k in fitted.added)


def cost(one: Fitted) -> float:
    """χ² with what the values of the effects cost."""
    return one.chi2 + PENALTY * one.size
