"""All candidates for a fitted hypothesis, screened, and the few that are worth a fit."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from delaytools.blocks.block import Sampled
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, at_values, fit_hypothesis
from delaytools.diagnosis.own_candidates import own_candidates
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.quantisers import quantisations, with_step_fitted
from delaytools.diagnosis.screen import Base, Screened, base_of, response, screened
from delaytools.diagnosis.spectra import interferences, modes
from delaytools.diagnosis.starts import candidates
from delaytools.diagnosis.stepwise import with_period_fitted
from delaytools.diagnosis.swings import swings
from delaytools.diagnosis.treads import within_steps
from delaytools.diagnosis.windows import edges_beside, transients, with_edges_fitted
from delaytools.loop.port import find_port
from delaytools.loop.values import resolve

__all__ = ["PENALTY", "is_sharpened", "proposals", "sharpened_again", "shortlisted"]

PENALTY = 20.0  # χ² that every value of an effect costs
LEAST = 25.0  # χ² below which a candidate is not worth a fit
PLACES = {"periodic_interference": 3, "flexible_mode": 5, "cross_coupling": 3, "parameter_change": 4}
NEARLY, MOST_NEAR = 0.9, 5  # of a kind's best worth: places that promise so much are all fitted, up to so many
MOST = 14
OFF = 1e-3  # of a value: how far it may be off beside other values
CLOSE = 1e-6  # of a fit beside what no derivative fits: ENOUGH must be far more than it leaves
TURNS, ENOUGH = 10, 1.0  # in which it is sought again, and χ² below which that is not worth another one


def proposals(case: Case, fitted: Fitted, *, instead: bool = False) -> list[Screened]:
    """The shortlist of candidates beside what the hypothesis already holds, the most promising first.

    instead: candidates in the place of an effect that is known; after the deadline none. By runs of usual steps: what a
    candidate changes hardly knows the error that both runs have.
    """
    base = base_of(case if case.finer == 1 else replace(case, finer=1, _replays={}), fitted)
    base = replace(base, instead=instead)
    return sharpened(base, shortlisted(_all(base)))


def _all(base: Base) -> list[Screened]:
    """Every candidate with what it could take off, the most first; those that time allows."""
    places, view = spots(base.case.segment), base.view
    found = screened(base, (*candidates(view, places), *own_candidates(view)))
    for sought in (
        lambda: interferences(base, places), lambda: modes(base, view, places), lambda: transients(base, places),
        lambda: swings(base, places), lambda: quantisations(base, view, places), lambda: _dropped(base),
    ):  # fmt: skip
        found += [] if base.is_late else sought()
    taken = {one.key for one in base.fitted.added}
    return sorted((s for s in found if s.added.key not in taken), key=_worth, reverse=True)


def _dropped(base: Base) -> list[Screened]:
    """Dropped frames where the logs show them, by the share that was lost."""
    found, loop = [], resolve(base.case.segment.loop)
    for at, share in base.case.lost.items():
        block = loop[find_port(loop, at).element].block
        if share > 0 and isinstance(block, Sampled):
            updates = sum(r.time[-1] - r.time[0] for r in base.case.records) / float(block.period)
            error = {"probability": (share * (1 - share) / updates) ** 0.5}
            one = Added(
                "dropped_frames", at, {"probability": share}, {}, frozenset({"probability"}), {}, error
            )
            change = response(base, one)
            found.append(Screened(one, 0.0 if change is None else base.gain(change)[0]))
    return found


def _worth(one: Screened) -> float:
    return one.gain - PENALTY * len(one.added.values)


def shortlisted(found: Sequence[Screened], *, part: float = 0.15) -> list[Screened]:
    """The best places of every kind whose worth is at least `part` of the best worth there is."""
    if not found:
        return []
    top = _worth(found[0])
    count: dict[str, int] = defaultdict(int)
    first: dict[str, float] = {}
    kept = []
    for one in found:
        kind, worth = one.added.kind.partition(":")[0], _worth(one)
        first.setdefault(kind, worth)
        most = PLACES.get(kind, 2) if worth < NEARLY * first[kind] else MOST_NEAR
        if worth < max(LEAST, part * top) or count[kind] >= most:
            continue
        count[kind] += 1
        kept.append(one)
    return kept[:MOST]


def sharpened(base: Base, found: Sequence[Screened]) -> list[Screened]:
    """The shortlist with what no derivative can fit: the periods of resamplings, the edges of transients.

    Where each trial of an edge is a run (in real runs, and where the way to the exits is not linear) only those of the
    most promising candidate: the best hypothesis is sharpened later. None after the deadline.
    """
    if base.case.pieces:
        return list(found)
    return [
        _SHARPEN[one.added.kind](base, one.added) if one.added.kind in _SHARPEN and _pays(base, one, place) else one
        for place, one in enumerate(found)
    ]


def _pays(base: Base, one: Screened, place: int) -> bool:
    """Whether a candidate is sharpened: it costs little, or it is the first one."""
    if base.case.is_late:
        return False
    way = base.way(one.added.at) if one.added.kind == "transient_gain" and place else None
    return place == 0 or one.added.kind != "transient_gain" or (way is not None and way.is_quick)


def is_sharpened(fitted: Fitted) -> bool:
    """Whether the last effect has values that no derivative fits."""
    return fitted.added[-1].kind in _SHARPEN


def sharpened_again(case: Case, fitted: Fitted) -> Fitted:
    """The hypothesis with what no derivative fits of its last effect sought again beside the values fitted with it.

    In turn with these, until neither moves, or time is up: a step and a natural frequency may go far together.
    """
    for _ in range(TURNS if is_sharpened(fitted) else 0):
        if case.is_late:
            break
        *rest, one = fitted.added
        found = edges_beside(base_of(case, fitted)) if one.kind == "transient_gain" else None
        if found is None:
            base = base_of(case, at_values(case, tuple(rest), fitted))
            roughly = replace(one, errors={name: OFF * one.values[name] for name in one.errors})
            found = _SHARPEN[one.kind](base, roughly).added
        moved = fit_hypothesis(case, (*rest, found), near=fitted, tolerance=CLOSE)
        moved = within_steps(case, moved) if one.kind == "quantization" else moved
        if moved.chi2 > fitted.chi2 - ENOUGH:
            return moved if moved.chi2 < fitted.chi2 else _with_errors(fitted, found)
        fitted = moved
    return fitted


def _with_errors(fitted: Fitted, found: Added) -> Fitted:
    """The hypothesis with the errors of its last effect as they are where it stands."""
    return replace(fitted, added=(*fitted.added[:-1], replace(fitted.added[-1], errors=found.errors)))


_SHARPEN = {"quantization": with_step_fitted, "sample_hold": with_period_fitted, "transient_gain": with_edges_fitted}
