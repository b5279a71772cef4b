"""What a search found in one segment, as plain figures that can travel between processes."""

from collections.abc import Mapping
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
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis, has_odd_rows
from delaytools.diagnosis.heldout import PIECE, held_out, rms_band
from delaytools.diagnosis.hint import hint
from delaytools.diagnosis.next_experiment import next_experiment
from delaytools.diagnosis.noise import (
    Whitening,
    autoregression,
    incoherent_spectrum,
    whitening,
    without_odd_rows,
)
from delaytools.diagnosis.noise_of import features, references
from delaytools.diagnosis.quantities import quantities
from delaytools.diagnosis.search import MOST, PENALTY, Finding
from delaytools.diagnosis.structure import Band, structured_bands
from delaytools.diagnosis.unevenness import loudest
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["SegmentReport", "segment_report"]

Array = NDArray[np.float64]
ALIKE = 12.0  # χ² (values paid for) within which two effects explain the logs equally well
LEFT = 0.06  # power of structure left, of the noise: a quarter of its rms
IN_A_BAND = 1.25  # the same in one octave
CHANCE = 1e-8
EDGES = ("start", "end")
EVEN = ("bias", "scale_factor", "cross_coupling", "flexible_mode", "periodic_interference")  # leave noise as even
WINDOW = "transient_gain"  # two of them can follow whatever depends on how much a signal moves


@final
@dataclass(frozen=True, eq=False)
class SegmentReport:
    """Everything of one segment that an answer needs.

    steps: rungs of the ladder, each with the bands of its whitened rms.
    outputs: per log (n, exits) of the fitted model. directions: per log (n, exits, k), one standard error of each
    fitted value. noise: of each exit.
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
    left = _unexplained(case, fitted, found.sent) or _imitated(case, fitted)
    sets = [_alike(found, k) for k in range(len(fitted.added))]
    confusable = tuple(
        Confusable(
            case.exits[0], (_rival(case, fitted, fitted, place), *(_rival(case, one, fitted) for one in members))
        )
        for place, members in enumerate(sets)
        if members
    )
    missing = tuple(_missing(found, k, certain=not sets[k] and not left) for k in places_in_file(fitted.added))
    return SegmentReport(
        case.exits, case.outputs(fitted.added, fitted.values), _directions(case, fitted), case.whitening,
        missing, _ranking(found), confusable, _steps(found, adequate=not left), left, _tolerated(case, fitted),
        _notes(found), found.exhausted, _next(case, fitted, sets),
    )  # fmt: skip


def _imitated(case: Case, fitted: Fitted) -> tuple[Unexplained, ...]:
    """Sets of effects that explain everything by their number alone: such sets imitate an unknown effect well."""
    generic = {one.fixed.get("source") for one in fitted.added if "source" in one.fixed}
    windows = [one for one in fitted.added if one.kind == WINDOW]
    if len(fitted.added) < MOST and len(generic) < 2 and len(windows) < 2:
        return ()
    words = f"{len(fitted.added)} effects are needed here: together they may imitate one that is not in the catalogue"
    return (Unexplained(case.exits[0], 0.0, (), words),)


def _next(case: Case, fitted: Fitted, sets: list[tuple[Fitted, ...]]) -> NextExperiment | None:
    """The experiment that parts one of the equivalence sets best."""
    found = [one for members in sets if members and (one := next_experiment(case, fitted, members)) is not None]
    return max(found, key=lambda one: one.expected_delta_chi2, default=None)


def _directions(case: Case, fitted: Fitted) -> tuple[Array, ...]:
    """What one standard error of each fitted value does to the outputs, of those that no derivative fits included."""
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
    return tuple(found)


def _moved_by(added: tuple[Added, ...], place: int, name: str, error: float) -> tuple[Added, ...]:
    one = added[place]
    return (*added[:place], one.moved({name: one.values[name] + error}), *added[place + 1 :])


def _alike(found: Finding, place: int) -> tuple[Fitted, ...]:
    """Rivals of an effect that explain the logs as well, of another kind than it."""
    mine = found.fitted.added[place]
    best = _cost(found.fitted)
    members: dict[str, Fitted] = {}
    for one in found.rivals[place] if place < len(found.rivals) else ():
        other = one.added[-1]
        if len(one.added) != len(found.fitted.added) or other.kind == mine.kind:
            continue
        mine_out, other_out = (held_out(f, found.case.rows) for f in (found.fitted, one))
        gain, spread = mine_out.better_than(other_out)
        if found.case.pieces:
            paid = gain + PENALTY * (one.size - found.fitted.size)
            alike = paid < max(ALIKE, _significant(len(mine_out.blocks)) * spread)
        else:
            alike = _cost(one) - best < max(ALIKE, min(spread, 3 * ALIKE))
        if alike:
            members.setdefault(other.kind, one)
    return tuple(members.values())


def _significant(blocks: int) -> float:
    """Standard errors by which one effect must beat another in real runs, whose errors are the model's: Student's t.

    What differs from block to block, not the noise, says there how far a difference can be trusted.
    """
    return float(student.ppf(0.975, max(blocks - 1, 1)))


def _cost(one: Fitted) -> float:
    return one.chi2 + PENALTY * one.size


def _missing(found: Finding, place: int, *, certain: bool) -> Missing:
    case, fitted = found.case, found.fitted
    one = fitted.added[place]
    same = [r.added[-1] for r in (found.rivals[place] if place < len(found.rivals) else ())]
    also = tuple(dict.fromkeys(o.at for o in same if o.kind == one.kind and o.at != one.at))
    settings = {**one.fixed, **{n: v for n, v in one.values.items() if n not in one.reported}}
    values = quantities(case.segment.loop, fitted, place)
    return Missing(one.kind, one.at, shown_at(case, one), values, settings, certain, also)


def shown_at(case: Case, one: Added) -> str:
    """The measured signal at which an effect shows: its own port where that is measured, else the first exit."""
    return case.exits[case.exit_at(one.at) or 0]


def _rival(case: Case, one: Fitted, best: Fitted, place: int = -1) -> Rival:
    """A hypothesis by the effect at a place in it, the last one where none is said."""
    place %= len(one.added)
    added: Added = one.added[place]
    out = held_out(one, case.rows)
    null = held_out(best, case.rows)
    gain, _ = out.better_than(null)
    rms = float(np.sqrt(np.mean(out.residual**2)))
    settings = {**added.fixed, **{n: v for n, v in added.values.items() if n not in added.reported}}
    values = quantities(case.segment.loop, one, place)
    return Rival(added.kind, added.at, values, settings, rms, gain, one.chi2 - best.chi2)


def _ranking(found: Finding) -> tuple[Rival, ...]:
    """All fitted candidates against the hypothesis without any effect, the best first."""
    null = found.null
    every = [found.fitted, *(r for group in found.rivals for r in group)] if found.fitted.added else []
    rivals = []
    for one in every:
        rival = _rival(found.case, one, found.fitted)
        gain, _ = held_out(one, found.case.rows).better_than(held_out(null, found.case.rows))
        rivals.append(Rival(rival.effect, rival.at, rival.parameters, rival.settings, rival.held_out_rms, gain,
                            rival.delta_chi2))  # fmt: skip
    return tuple(sorted(rivals, key=lambda r: r.held_out_rms))


def _unexplained(case: Case, fitted: Fitted, sent: tuple[Array, ...]) -> tuple[Unexplained, ...]:
    outputs = case.outputs(fitted.added, fitted.values)
    left = _left_over(case, outputs)
    found = []
    for j, exit in enumerate(case.exits):
        residual = left[0][:, j]
        white = without_odd_rows(case.whitening[j].apply(residual), least=1.0)
        inputs = features(case, outputs, 0)
        bands = structured_bands(white, inputs, case.whitening[j].apply(sent[j]))
        bad = [b for b in bands if b.share > IN_A_BAND and b.probability < CHANCE]
        whole = sum(b.share * 2 * (b.high - b.low) for b in bands if b.probability < CHANCE)
        if bad or whole > LEFT:
            bad = [b for b in bands if b.probability < CHANCE]
            found.append(replace(_left(case, exit, bad, (white, inputs)), hint=hint(case, fitted, j)))
        elif not _gates_noise(case, fitted, j):
            found += _uneven(case, (outputs[0], white, case.whitening[j].apply(sent[j])), exit)
    return tuple(found)


def _gates_noise(case: Case, fitted: Fitted, exit: int) -> bool:
    """Whether the noise of an exit may pass an effect, at its port, that lets through now more, now less."""
    designed = [e.name.partition("#")[0].partition("@") for e in case.segment.loop.elements if "@" in e.name]
    found = [(one.kind, one.at) for one in fitted.added] + [(kind, at) for kind, _, at in designed]
    return any(case.exit_at(at) == exit and kind not in EVEN for kind, at in found)


def _uneven(case: Case, rows: tuple[Array, Array, Array], exit: str) -> list[Unexplained]:
    """What is left where it is much louder at some level or rate of a signal; rows: modelled exits, residual, sent."""
    outputs, white, sent = rows
    record = case.records[0]
    signals = {n: record[n] for n in case.segment.entries if n in record}
    signals |= {n: outputs[:, k] for k, n in enumerate(case.exits)}
    one = loudest(white, signals, sent, case.step)
    if one is None:
        return []
    what = f"the rate of {one.signal}" if one.is_rate else one.signal
    words = f"what is left is {one.power:.1f} times as strong as in all where {what} is within " \
        f"{one.low:.3g} and {one.high:.3g}: noise is as strong everywhere"
    return [Unexplained(exit, one.share, (), words)]


def _left_over(case: Case, outputs: tuple[Array, ...]) -> tuple[Array, ...]:
    """Per log (n, exits): measured minus model, less what uncertain values of other segments can do."""
    return case.without_nuisance(tuple(m - y for m, y in zip(case.measured, outputs, strict=True)))


def _left(case: Case, exit: str, bands: list[Band], rows: tuple[Array, Array]) -> Unexplained:
    total = float(np.mean(rows[0] ** 2))
    power = sum(b.share * 2 * (b.high - b.low) for b in bands)
    limits = tuple((b.low / case.step, b.high / case.step) for b in bands)
    return Unexplained(exit, min(power / max(total, 1e-300), 1.0), limits, "")


def _steps(
    found: Finding, *, adequate: bool
) -> tuple[tuple[Step, Mapping[str, tuple[float, float]]], ...]:
    """The ladder of this segment: as designed, tolerances fitted, and one rung for every effect."""
    case = _seen_plainly(found.case, found.fitted, adequate)
    nominal = case.parameters(())
    bare = case.residual(case.outputs((), tuple(p.value for p in nominal)))
    steps = [_step(case, "as designed", Fitted((), (), bare, np.zeros((len(bare), 0))), ())]
    last = None
    for count in range(len(found.fitted.added) + 1):
        added = found.fitted.added[:count]
        if count == 0 and not nominal:
            continue
        try:
            last = fit_hypothesis(case, added, near=last or found.null)
        except DelaytoolsError:  # unstable without what is still to come: no rung of its own
            continue
        label = f"+ {added[-1].name}" if added else "tolerances fitted"
        steps.append(_step(case, label, last, last.values))
    return tuple(steps)


def _seen_plainly(case: Case, fitted: Fitted, adequate: bool) -> Case:
    """The case with filters that make the final residual white, without floors: 1 is what is left at the end."""
    outputs = case.outputs(fitted.added, fitted.values)
    left = _left_over(case, outputs)
    filters = []
    for j in range(len(case.exits)):
        residual = without_odd_rows(left[0][:, j]) if has_odd_rows(case, fitted.added) else left[0][:, j]
        seen = incoherent_spectrum(residual, references(case, 0))
        filters.append(autoregression(residual) if adequate else whitening(*seen))
    return case.whitened_by(tuple(filters))


def _step(
    case: Case, label: str, fitted: Fitted, values: tuple[float, ...]
) -> tuple[Step, Mapping[str, tuple[float, float]]]:
    start = values or tuple(p.value for p in case.parameters(()))
    left = _left_over(case, case.outputs(fitted.added, start))
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
    return tuple(
        f"{one.name} is significant at {found.case.exits[0]} but smaller than a quarter of the noise: not named"
        for one in found.small
    )
