"""What a search found in one segment, as plain figures that can travel between processes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from delaytools.diagnosis.added import Added, places_in_file
from delaytools.diagnosis.answer import (
    Confusable,
    Missing,
    NextExperiment,
    Quantity,
    Rival,
    Step,
    Unexplained,
)
from delaytools.diagnosis.attempts import attempt, cost
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.edges import EDGES
from delaytools.diagnosis.fitting import STEPS, Fitted, at_values, fit_hypothesis, has_odd_rows
from delaytools.diagnosis.heldout import PIECE, HeldOut, held_out, rms_band
from delaytools.diagnosis.lattices import rounded_exits
from delaytools.diagnosis.leftover import imitated, left_over, unexplained
from delaytools.diagnosis.next_experiment import next_experiment
from delaytools.diagnosis.noise import (
    Whitening,
    autoregression,
    incoherent_spectrum,
    whitening,
    without_odd_rows,
)
from delaytools.diagnosis.noise_of import references
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.proposals import PENALTY
from delaytools.diagnosis.quantities import quantities
from delaytools.diagnosis.search import Finding
from delaytools.diagnosis.upgrades import breaking_away_as_well
from delaytools.diagnosis.worth import UNKNOWN, WORTHLESS, most_of
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["SegmentReport", "segment_report"]

Array = NDArray[np.float64]
MOST_ALIKE = 3  # rivals of a set: who has more to choose from is told nothing
SAME = 1.0  # χ² by which runs of what does the same may differ
ALIKE = 12.0  # χ² (values paid for) within which two effects explain the logs equally well


@final
@dataclass(frozen=True, eq=False)
class SegmentReport:
    """Everything of one segment that an answer needs.

    steps: rungs of the ladder, each with the bands of its whitened rms.
    outputs: per log (n, exits) of the fitted model, with what uncertain columns most likely did. directions: per log
    (n, exits, k), one standard error of each fitted value. noise: of each exit.
    """

    exits: tuple[str, ...]
    outputs: tuple[Array, ...]
    directions: tuple[Array, ...]
    noise: tuple[Whitening, ...]
    missing: tuple[Missing, ...]
    ranking: tuple[Rival, ...]
    confusable: tuple[Confusable, ...]
    steps: tuple[tuple[Step, Mapping[str, tuple[float, float]]], ...]
    unexplained: tuple[Unexplained, ...]
    tolerated: Mapping[str, Quantity]
    notes: tuple[str, ...]
    exhausted: bool
    next_experiment: NextExperiment | None = None


def segment_report(found: Finding) -> SegmentReport:
    """The figures of a search."""
    case, fitted = found.case, found.fitted
    left = unexplained(case, fitted, found.sent) or imitated(case, fitted)
    sets = [_alike(found, k) for k in range(len(fitted.added))]
    null = held_out(found.null, case.rows)
    confusable = tuple(
        Confusable(
            case.exits[0], (_rival(found, fitted, null, place), *(_rival(found, one, null) for one in members))
        )
        for place, members in enumerate(sets)
        if members
    )
    certain = [not (members or left or found.exhausted) for members in sets]
    missing = tuple(_missing(found, k, sets, certain=certain[k]) for k in places_in_file(fitted.added))
    rounded = rounded_exits(case, fitted)
    outputs = _on_steps(case, _as_it_was(case, fitted), rounded)
    directions = _directions(case, fitted, sets)
    for rows in directions:
        rows[:, list(rounded)] = 0.0
    return SegmentReport(
        case.exits, outputs, directions, case.whitening,
        missing, _ranking(found, null), confusable, _steps(found, adequate=not left), left, _tolerated(case, fitted),
        _notes(found), found.exhausted, _next(case, fitted, sets),
    )  # fmt: skip


def _as_it_was(case: Case, fitted: Fitted) -> tuple[Array, ...]:
    """Per log (n, exits): the exits without their noise, as far as the model goes."""
    left = left_over(case, case.outputs(fitted.added, fitted.values))
    return tuple(m - rows for m, rows in zip(case.measured, left, strict=True))


def _on_steps(case: Case, outputs: tuple[Array, ...], rounded: Mapping[int, float]) -> tuple[Array, ...]:
    """The outputs, rounded exits on the step that each measured row shows."""
    for rows, measured in zip(outputs, case.measured, strict=True):
        for exit, step in rounded.items():
            rows[:, exit] = step * np.round(measured[:, exit] / step)
    return outputs


def _next(case: Case, fitted: Fitted, sets: list[tuple[Fitted, ...]]) -> NextExperiment | None:
    """The experiment that parts one of the equivalence sets best."""
    found = [one for members in sets if members and (one := next_experiment(case, fitted, members)) is not None]
    return max(found, key=lambda one: one.expected_delta_chi2, default=None)


def _directions(case: Case, fitted: Fitted, sets: Sequence[tuple[Fitted, ...]] = ()) -> tuple[Array, ...]:
    """What one standard error of each fitted value does to the outputs, of those that no derivative fits included; and
    what each rival that explains the logs as well would do instead."""
    stds = np.array([p.std for p in fitted.parameters])
    sure = np.isfinite(stds) & (stds > 0)
    found = [np.zeros((*m.shape, 0)) for m in case.measured]
    if sure.any():
        slopes = [replay.run_with_derivatives(fitted.values)[1] for replay in case.replays(fitted.added)]
        found = [rows[:, :, sure] * stds[sure] for rows in slopes]
    stepped = [(k, n) for k, one in enumerate(fitted.added) for n in one.held if one.errors.get(n, 0.0) > 0]
    for place, name in stepped:
        error = fitted.added[place].errors[name]
        if name in EDGES:
            error = max(error, 0.5 * case.step)  # rows show no more of a jump, what they drive feels all of it
        ends = [case.outputs(_moved_by(fitted.added, place, name, e), fitted.values) for e in (error, -error)]
        moved = [0.5 * (after - before)[:, :, None] for after, before in zip(*ends, strict=True)]
        found = [np.concatenate(both, axis=2) for both in zip(found, moved, strict=True)]
    outputs = case.outputs(fitted.added, fitted.values)
    for one in (rival for members in sets for rival in members):
        others = case.outputs(one.added, one.values)
        changes = [(other - own)[:, :, None] for own, other in zip(outputs, others, strict=True)]
        found = [np.concatenate(both, axis=2) for both in zip(found, changes, strict=True)]
    if any(one.along for one in fitted.added):
        found = [np.concatenate(both, axis=2) for both in zip(found, case.nuisance_left(), strict=True)]
    return tuple(found)


def _moved_by(added: tuple[Added, ...], place: int, name: str, error: float) -> tuple[Added, ...]:
    one = added[place]
    return (*added[:place], one.moved({name: one.values[name] + error}), *added[place + 1 :])


def _alike(found: Finding, place: int) -> tuple[Fitted, ...]:
    """Rivals of an effect that explain the logs as well and say something else than it, the best first."""
    mine = found.fitted.added[place]
    best = cost(found.fitted)
    said, members = _said(found.case, mine), dict[object, Fitted]()
    for one in found.rivals[place]:
        claim = _said(found.case, one.added[-1])
        if len(one.added) != len(found.fitted.added) or claim == said:
            continue
        mine_out, other_out = (held_out(f, found.case.rows) for f in (found.fitted, one))
        gain, spread = mine_out.better_than(other_out)
        if found.case.pieces:
            paid = gain + PENALTY * (one.size - found.fitted.size)
            alike = paid < max(ALIKE, _significant(len(mine_out.blocks)) * spread)
        else:
            alike = cost(one) - best < max(ALIKE, min(spread, 3 * ALIKE))
        if alike:
            members.setdefault(claim, one)
    if mine.kind == "coulomb_friction" and not found.case.pieces and not found.case.is_late:
        other = breaking_away_as_well(found.case, found.fitted, place)
        if other is not None and other.chi2 < found.fitted.chi2 + ALIKE:
            members.setdefault(_said(found.case, other.added[-1]), other)
    return tuple(sorted(members.values(), key=cost)[:MOST_ALIKE])


def _said(case: Case, one: Added) -> tuple[object, ...]:
    """What naming an effect claims: its kind, the measured signal at which it shows, and its source. At another port
    ahead of that signal it may do just the same, which `also_at` says."""
    return one.kind, shown_at(case, one), tuple(sorted(one.fixed.items()))


def _significant(blocks: int) -> float:
    """Standard errors by which one effect must beat another in real runs, whose errors are the model's: Student's t.

    What differs from block to block, not the noise, says there how far a difference can be trusted.
    """
    return float(student.ppf(0.975, max(blocks - 1, 1)))


def _missing(found: Finding, place: int, sets: Sequence[tuple[Fitted, ...]], *, certain: bool) -> Missing:
    case, fitted = found.case, found.fitted
    one = fitted.added[place]
    close = [r for r in found.rivals[place] if cost(r) - cost(fitted) < ALIKE]
    same = [r.added[-1] for r in close if len(r.added) == len(fitted.added)]
    also = [o.at for o in same if _said(case, o) == _said(case, one)] + _where_windows_do_the_same(case, fitted, place)
    also = [at for at in dict.fromkeys(also) if at != one.at]
    settings = {**one.fixed, **{n: v for n, v in one.values.items() if n not in one.reported}}
    values = _spread_over(quantities(case.segment.loop, fitted, place), one, [f for group in sets for f in group])
    return Missing(one.kind, one.at, shown_at(case, one), values, settings, certain, tuple(also))


def _where_windows_do_the_same(case: Case, fitted: Fitted, place: int) -> list[str]:
    """Ports at which a window of gain, as it is, changes the exits as it does at its own, so far as the logs can tell.

    Its edges are sought for each port by itself and may come out a little apart: too far for a rival that is as good.
    """
    one = fitted.added[place]
    if one.kind != "transient_gain" or case.is_late:
        return []
    outputs, found = case.outputs(fitted.added, fitted.values), []
    for port in (str(spot.port) for spot in spots(case.segment) if spot.kind == one.kind):
        moved = (*fitted.added[:place], replace(one, at=port), *fitted.added[place + 1 :])
        pairs = zip(case.outputs(moved, fitted.values), outputs, strict=True)
        change = case.whitened(tuple(there - here for there, here in pairs))
        if float(change @ change) < SAME and shown_at(case, moved[place]) == shown_at(case, one):
            found.append(port)
    return found


def _spread_over(values: dict[str, Quantity], one: Added, rivals: Sequence[Fitted]) -> dict[str, Quantity]:
    """The values of an effect with errors that allow for what it is beside the rivals of other effects, evenly."""
    others = [a.values for rival in rivals for a in rival.added if a.key == one.key]
    apart = {name: max((abs(v[name] - one.values[name]) for v in others), default=0.0) for name in values}
    return {name: replace(q, std=float(np.hypot(q.std, apart[name] / np.sqrt(3)))) for name, q in values.items()}


def shown_at(case: Case, one: Added) -> str:
    """The measured signal at which an effect shows: its own port where that is measured, else the first exit."""
    return case.exits[case.exit_at(one.at) or 0]


def _rival(found: Finding, one: Fitted, null: HeldOut, place: int = -1) -> Rival:
    """A hypothesis by the effect at a place in it, the last one where none is said; null: without any effect."""
    place %= len(one.added)
    added, out = one.added[place], held_out(one, found.case.rows)
    rms = float(np.sqrt(np.mean(out.residual**2)))
    settings = {**added.fixed, **{n: v for n, v in added.values.items() if n not in added.reported}}
    values = quantities(found.case.segment.loop, one, place)
    worse = one.chi2 - found.fitted.chi2
    return Rival(added.kind, added.at, values, settings, rms, out.better_than(null)[0], worse)


def _ranking(found: Finding, null: HeldOut) -> tuple[Rival, ...]:
    """All fitted candidates, the best on held-out data first."""
    every = [found.fitted, *(r for group in found.rivals for r in group)] if found.fitted.added else []
    return tuple(sorted((_rival(found, one, null) for one in every), key=lambda r: r.held_out_rms))


def _steps(
    found: Finding, *, adequate: bool
) -> tuple[tuple[Step, Mapping[str, tuple[float, float]]], ...]:
    """The ladder of this segment: as designed, tolerances fitted, and one rung for every effect."""
    case = _seen_plainly(found.case, found.fitted, adequate)
    again = None if case.is_late else attempt(case, found.fitted.added, found.fitted, STEPS)
    if again is not None:  # where hardly anything is left, the values move with the filters
        case = _seen_plainly(case, again, adequate)
    nominal = case.parameters(())
    bare = case.residual(case.outputs((), tuple(p.value for p in nominal)))
    steps = [_step(case, "as designed", Fitted((), (), bare, np.zeros((len(bare), 0))), ())]
    last = None
    for count in range(len(found.fitted.added) + 1):
        added = found.fitted.added[:count]
        if count == 0 and not nominal:
            continue
        try:
            if case.is_late and added == found.fitted.added:
                last = at_values(case, added, found.fitted)
            else:
                last = fit_hypothesis(case, added, near=last or found.null, evaluations=2 if case.is_late else STEPS)
        except DelaytoolsError:  # unstable without what is still to come: no rung of its own
            continue
        label = f"+ {added[-1].name}" if added else "tolerances fitted"
        steps.append(_step(case, label, last, last.values))
    return tuple(steps)


def _seen_plainly(case: Case, fitted: Fitted, adequate: bool) -> Case:
    """The case with filters that make the final residual white, without floors: 1 is what is left at the end."""
    outputs = case.outputs(fitted.added, fitted.values)
    left = left_over(case, outputs)
    filters = []
    for j in range(len(case.exits)):
        cut = without_odd_rows if has_odd_rows(case, fitted.added) else np.asarray
        residuals = [cut(rows[:, j]) for rows in left]
        if adequate and not case.pieces:
            filters.append(autoregression(residuals))
        else:
            filters.append(whitening(*incoherent_spectrum(residuals[0], references(case, 0))))
    return case.whitened_by(tuple(filters))


def _step(
    case: Case, label: str, fitted: Fitted, values: tuple[float, ...]
) -> tuple[Step, Mapping[str, tuple[float, float]]]:
    start = values or tuple(p.value for p in case.parameters(()))
    left = left_over(case, case.outputs(fitted.added, start))
    out = held_out(fitted, case.rows)
    errors, white, band = {}, {}, {}
    blocks = case.rows.blocks(PIECE)
    for j, exit in enumerate(case.exits):
        here = case.rows.exit == j
        inside = float(np.sqrt(np.mean(fitted.residual[here] ** 2)))
        white[exit] = float(np.sqrt(np.mean(out.residual[here] ** 2)))
        band[exit] = rms_band(out.residual[here], blocks[here])
        rms = float(np.sqrt(np.mean(np.concatenate([rows[:, j] for rows in left]) ** 2)))
        errors[exit] = rms * (white[exit] / inside if inside > 0 else 1.0)
    return Step(label, errors, white), band


def _tolerated(case: Case, fitted: Fitted) -> dict[str, Quantity]:
    own = {p.path for p in case.tolerated}
    return {p.path: Quantity(p.value, p.std) for p in fitted.parameters if p.path in own}


def _notes(found: Finding) -> tuple[str, ...]:
    """What was refused although it pays, where a search ends by its rule, and what acts along the measured motion."""
    words = [
        f"{one.name} drives its block away: it is judged along the measured motion, since a run of the segment alone "
        f"drifts off its log however right its values are"
        for one in found.fitted.added if one.along
    ]  # fmt: skip
    if found.case.pieces and len(found.fitted.added) >= most_of(found.case):
        most = f"{most_of(found.case)} effects at {found.case.exits[0]} are the most that a real run is given"
        words.append(f"{most}: what is left is the model's error, and a further effect would imitate it")
    elif found.refused is not None and found.refused[1] not in (WORTHLESS, UNKNOWN):
        one, why = found.refused
        words.append(f"{one.name} at {found.case.exits[0]} is {why}: not named")
    return tuple(words)
