"""The run that would decide between rivals: T-optimality over the inputs that a bench can be given.

Atkinson & Fedorov 1975, Biometrika 62: the best design is the one where the least remaining difference between the
rivals, each with the values that suit it best, is largest.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.design.inputs import Setting, stimulus
from delaytools.diagnosis.added import by_itself, path_of, with_added
from delaytools.diagnosis.answer import NextExperiment
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.deciding import inseparable, words
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.trials import DOUBLE, Trial, trials
from delaytools.estimation.least_squares import estimate
from delaytools.loop.edit import reader
from delaytools.loop.loop import Loop
from delaytools.loop.values import with_numbers
from delaytools.signals.stimulus import Column, Stimulus
from delaytools.signals.trouble import DelaytoolsError
from delaytools.simulation.replay import Replay

__all__ = ["next_experiment"]

Array = NDArray[np.float64]
SECONDS = 20.0  # of the run that is suggested
ROWS = 6000  # of the run that is simulated; χ² is then scaled to SECONDS
ENTRIES, RIVALS, REFITTED = 2, 3, 6
STEPS = 8
DECISIVE = 60.0  # χ² that settles the matter
PREFERRED = 0.05  # of the largest χ²: a trial that the rules of thumb name is taken from here on


def next_experiment(case: Case, best: Fitted, rivals: Sequence[Fitted]) -> NextExperiment | None:
    """The input that best tells the best hypothesis from its rivals, and the χ² by which a run of 20 s would.

    Every trial is simulated with the best hypothesis; each rival is then fitted to that run, held to what the logs
    already say of its values, and what still differs is counted in units of the noise. The least over the rivals
    counts. Where no input of the segment decides, the answer says what to measure. None without rivals.
    """
    chosen = tuple(rivals)[:RIVALS]
    if not chosen or not best.added:
        return None
    bench = _Bench(case, _resolved(best, case.step), tuple(_resolved(rival, case.step) for rival in chosen))
    found = _gains(bench)
    table = {trial: gains for trial, gains in found if max(gains) > 0}
    parted = [k for k in range(len(chosen)) if max((g[k] for g in table.values()), default=0.0) >= DECISIVE]
    if not parted:
        return inseparable(case, best, chosen, bench.catalogue())
    least = {trial: min(gains[k] for k in parted) for trial, gains in table.items()}
    decided = tuple(chosen[k] for k in parted)
    trial = _taken(least, words(best, decided).manner)
    why = words(best, decided).sentence(trial)
    return NextExperiment(why, {"signal": trial.signal, **trial.table}, least[trial])


def _taken(gains: Mapping[Trial, float], manner: str) -> Trial:
    """The trial with the largest χ², or the largest of the manner that the rule of thumb names where that decides."""
    top = max(gains, key=gains.__getitem__)
    named = [trial for trial in gains if trial.manner == manner]
    known = max(named, key=gains.__getitem__, default=top)
    return known if gains[known] >= max(DECISIVE, PREFERRED * gains[top]) else top


def _gains(bench: "_Bench") -> list[tuple[Trial, tuple[float, ...]]]:
    """Every trial with the χ² by which it would part each rival: all by one linear step, the best few refitted."""
    rough = [(trial, bench.gains(trial, refit=False)) for trial in bench.catalogue()]
    rough.sort(key=lambda pair: -min(pair[1]))
    manner = words(bench.best, bench.rivals).manner
    named = [pair for pair in rough if pair[0].manner == manner][:2]
    every = [*rough[:REFITTED], *(pair for pair in named if pair not in rough[:REFITTED])]
    for k in range(len(bench.rivals)):
        every.append(max(rough, key=lambda pair: pair[1][k]))
    kept = {id(pair[0]): pair[0] for pair in every}
    return [(trial, bench.gains(trial, refit=True)) for trial in kept.values()]


@final
@dataclass(frozen=True, eq=False)
class _Bench:
    """A segment on a bench, with the best hypothesis for the truth."""

    case: Case
    best: Fitted
    rivals: tuple[Fitted, ...]

    @property
    def time(self) -> Array:
        """Times of the rows of a simulated run, s."""
        return np.arange(min(ROWS, round(SECONDS / self.case.step)), dtype=np.float64) * self.case.step

    def catalogue(self) -> tuple[Trial, ...]:
        """Every trial at every entry that moved in the logs."""
        widths = [
            a.values["half_width"]
            for f in (self.best, *self.rivals)
            for a in f.added
            if "half_width" in a.values
        ]
        found: list[Trial] = []
        for entry in self.entries()[:ENTRIES]:
            peak = self.peak(entry)
            width, seconds = max(widths, default=0.0), float(self.time[-1])
            doubled = words(self.best, self.rivals).manner == DOUBLE
            found += trials(entry, peak, step=self.case.step, width=width, seconds=seconds, doubled=doubled)
        return tuple(found)

    def entries(self) -> tuple[str, ...]:
        """Columns that drive the segment and moved, its own exits left out."""
        sources = [str(s) for f in (self.best, *self.rivals) for a in f.added for s in a.fixed.values()]
        named = dict.fromkeys((*self.case.segment.entries, *sources))
        return tuple(
            n for n in named if n not in self.case.exits and n in self.case.records[0] and self.peak(n) > 0
        )

    def peak(self, entry: str) -> float:
        """Largest magnitude in the logs of what moves; 0 for a constant."""
        columns = [record[entry] for record in self.case.records]
        moved = max(float(np.ptp(u)) for u in columns) > 1e-9 * max(float(np.abs(u).max()) for u in columns)
        return max(float(np.abs(u).max()) for u in columns) if moved else 0.0

    def gains(self, trial: Trial, *, refit: bool) -> tuple[float, ...]:
        """χ² of a run of 20 s between the best hypothesis and each rival; 0 where the run fails."""
        driven = self._driven(trial)
        try:
            driven = self._with_exits(driven)
            truth = self._replay(self.best, driven).run(self.best.values)
            if not np.all(np.isfinite(truth)):
                return (0.0,) * len(self.rivals)
            scale = SECONDS / (len(self.time) * self.case.step)
            part = self._refitted if refit else self._projected
            return tuple(scale * part(rival, driven, truth) for rival in self.rivals)
        except (DelaytoolsError, np.linalg.LinAlgError, ValueError):
            return (0.0,) * len(self.rivals)

    def _driven(self, trial: Trial) -> dict[str, Stimulus]:
        """What drives the segment: the trial, constants as they were, all else at rest."""
        record = self.case.records[0]
        still: dict[str, Stimulus] = {}
        for name in record.names:
            if self.peak(name) == 0 and float(record[name][0]) != 0:
                still[name] = Column(time=self.time[[0, -1]], values=np.full(2, float(record[name][0])))
        return {**still, trial.signal: stimulus(trial.table, Setting())}

    def _with_exits(self, driven: dict[str, Stimulus]) -> dict[str, Stimulus]:
        """With the columns of exits that the segment itself reads, as the best hypothesis would log them."""
        loop = with_added(self.case.segment.loop, by_itself(self.best.added))
        reads = {reader(exit): exit for exit in self.case.exits}
        if not set(reads) & set(loop.externals):
            return driven
        elements = tuple(
            replace(
                e,
                inputs={port: x.renamed(reads) for port, x in e.inputs.items()},
                modifiers=tuple(
                    replace(p, instead={s: reads.get(n, n) for s, n in p.instead.items()})
                    for p in e.modifiers
                ),
            )
            for e in loop.elements
        )
        closed = replace(loop, elements=elements)
        rows = self._run_of(closed, self.best, driven).run(self.best.values)
        own = {reader(exit): _column(self.time, rows[:, j]) for j, exit in enumerate(self.case.exits)}
        return {**driven, **own}

    def _replay(self, fitted: Fitted, driven: Mapping[str, Stimulus]) -> Replay:
        return self._run_of(with_added(self.case.segment.loop, by_itself(fitted.added)), fitted, driven)

    def _run_of(self, loop: Loop, fitted: Fitted, driven: Mapping[str, Stimulus]) -> Replay:
        free = tuple(p.path for p in fitted.parameters)
        if self.case.numbers:
            own = {path: number for path, number in self.case.numbers[0].items() if path not in free}
            loop = with_numbers(loop, own)
        named = {name: driven[name] for name in loop.externals if name in driven}
        return Replay(loop, {**named, **_draws(loop, self.time)}, self.time, self.case.exits, free)

    def _whitened(self, rows: Array) -> Array:
        """(n, exits) or (n, exits, k) through the filters of the exits, one after the other."""
        return np.concatenate([w.apply(rows[:, j]) for j, w in enumerate(self.case.whitening)])

    def _projected(self, rival: Fitted, driven: Mapping[str, Stimulus], truth: Array) -> float:
        """Σ of the squared difference that one linear step of the rival's values leaves."""
        rows, slopes = self._replay(rival, driven).run_with_derivatives(rival.values)
        left = np.concatenate([self._whitened(truth - rows), np.zeros(len(rival.values))])
        J = np.vstack([self._whitened(slopes), _known(rival)])
        size = np.linalg.norm(J, axis=0)
        J = J[:, size > 0] / size[size > 0]
        weights = np.linalg.lstsq(J, left, rcond=1e-10)[0]
        return float(np.sum((left - J @ weights) ** 2))

    def _refitted(self, rival: Fitted, driven: Mapping[str, Stimulus], truth: Array) -> float:
        """Σ of the squared difference at the values of the rival that suit the run and the logs best."""
        replay, known, start = self._replay(rival, driven), _known(rival), np.array(rival.values)
        if not len(start):
            return float(np.sum(self._whitened(truth - replay.run(())) ** 2))

        def residual(x: Array) -> Array:
            return np.concatenate([self._whitened(truth - replay.run(tuple(x))), known @ (x - start)])

        def slopes(x: Array) -> Array:
            return np.vstack([-self._whitened(replay.run_with_derivatives(tuple(x))[1]), known])

        free = tuple(replace(p, std=float("nan")) for p in rival.parameters)
        found = estimate(residual, free, jacobian=slopes, coloured=False, tolerance=1e-4, evaluations=STEPS)
        return 2 * found.cost


def _resolved(fitted: Fitted, step: float) -> Fitted:
    """The hypothesis with friction smooth enough that one step per row resolves it."""
    least = {
        path_of(k, "smoothing"): abs(one.values["level"]) * step
        for k, one in enumerate(fitted.added)
        if "smoothing" in one.free and "level" in one.values
    }
    floors = [least.get(p.path, p.low) for p in fitted.parameters]
    moved = tuple(
        replace(p, value=max(p.value, low), low=low, high=max(p.high, low))
        for p, low in zip(fitted.parameters, floors, strict=True)
    )
    return replace(fitted, parameters=moved)


def _known(fitted: Fitted) -> Array:
    """(free, free): what the logs already say of a hypothesis' values, R of their whitened slopes."""
    count = len(fitted.values)
    if not count or len(fitted.jacobian) < count:
        return np.zeros((count, count))
    return np.asarray(np.linalg.qr(fitted.jacobian, mode="r"))


def _column(time: Array, values: Array) -> Stimulus:
    return Column(time=time, values=values, smooth=True)


def _draws(loop: Loop, time: Array) -> dict[str, Stimulus]:
    """Numbers between 0 and 1 for what a loop draws, the same for every hypothesis."""
    drawn = np.random.default_rng(1).uniform(size=len(time))
    return {
        name: Column(time=time, values=drawn, held=True) for name in loop.externals if name.endswith(".draw")
    }
