"""Sizes that show: each effect's size is searched so that its contribution at its exit is a drawn number of noises.

Contribution: rms difference between the segment with and without the effect, both driven by the same measured input.
Of an effect that no catalogue holds only that part counts which no gain, offset or time shift takes away.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.signal import cont2discrete, lfilter

from benchmarks.hidden_effects.cases import ROWS, Case, draw, generator, lane, plant
from benchmarks.hidden_effects.catalogue import Scale, shape
from benchmarks.hidden_effects.simulator import simulate

Array = np.ndarray
COARSE = 1  # steps per row while searching
GRIDS = (6, 4)  # runs per search
FINE = 10
ATTEMPTS = 12
HELD_SHARE = 1e-3  # "noise" of an exact held signal, of its rms
BOUND = 3.0  # largest peak, of the nominal run's
WITHIN = (0.8, 1.25)  # of the wished range of sizes


def solve(numbers: Sequence[int], seed: int) -> list[tuple[Case, dict[str, Array], list[dict]]]:
    """Cases of one bench with sizes found, their fine runs, and what each effect contributes."""
    done: dict[int, tuple[Case, dict[str, Array], list[dict]]] = {}
    for attempt in range(ATTEMPTS):
        found = _search([draw(n, seed, attempt) for n in numbers if n not in done])
        good = [case for case, fits in found if fits]
        if good:
            logs, details, starts = _measure(good, FINE)
            for case, parts, start in zip(good, details, starts, strict=True):
                mine = {name: log[:, start] for name, log in logs.items()}
                if all(_fits(case, i, part["size"]) for i, part in enumerate(parts)) and _sound(mine):
                    done[case.number] = (case, mine, parts)
        if len(done) == len(numbers):
            return [done[n] for n in numbers]
    raise RuntimeError(f"no sizes found for cases {[n for n in numbers if n not in done]}")


def _fits(case: Case, index: int, size: float) -> bool:
    low, high = case.wishes[index].sizes
    return WITHIN[0] * low <= size <= WITHIN[1] * high


def _sound(logs: Mapping[str, Array]) -> bool:
    return all(np.isfinite(log).all() for log in logs.values())


def _search(cases: list[Case]) -> list[tuple[Case, bool]]:
    """The sizes that give the drawn contributions, by two grids of runs, and whether they were found."""
    bench = cases[0].architecture
    nominal = simulate(bench, [lane(c, noisy=False) for c in cases], ROWS, COARSE)
    drawn = [_details(case, {n: x[:, i] for n, x in nominal.items()}) for i, case in enumerate(cases)]
    peaks = [{n: BOUND * np.abs(x[:, i]).max() for n, x in nominal.items()} for i in range(len(cases))]
    targets = [_targets(case) for case in cases]
    grids = [np.repeat(np.linspace(0, 1, GRIDS[0])[:, None], len(c.wishes), axis=1) for c in cases]
    sizes = _try(cases, drawn, grids, peaks)
    ends = [_bracket(x, s, t) for x, s, t in zip(grids, sizes, targets, strict=True)]
    grids = [np.linspace(low, high, GRIDS[1]) for low, high in ends]
    sizes = _try(cases, drawn, grids, peaks)
    out = []
    for case, details, x, s, t in zip(cases, drawn, grids, sizes, targets, strict=True):
        shares, found = _between(x, s, t)
        out.append(
            (_planted(case, details, shares), all(_fits(case, i, size) for i, size in enumerate(found)))
        )
    return out


def _try(cases: list[Case], drawn: list, grids: list[Array], peaks: list[dict]) -> list[Array]:
    """Sizes (grid x effects) at every grid point; infinite where the loop leaves its bounds."""
    tried = [_planted(c, d, x) for c, d, grid in zip(cases, drawn, grids, strict=True) for x in grid]
    logs, details, starts = _measure(tried, COARSE, thin=True)
    out, place = [], 0
    for grid, peak in zip(grids, peaks, strict=True):
        rows = []
        for k in range(place, place + len(grid)):
            bounded = all(np.abs(x[:, starts[k]]).max() < peak[n] for n, x in logs.items())
            rows.append([d["size"] if bounded else np.inf for d in details[k]])
        out.append(np.array(rows, dtype=float).reshape(len(grid), -1))
        place += len(grid)
    return out


def _bracket(grid: Array, sizes: Array, targets: Array) -> tuple[Array, Array]:
    """Neighbouring grid points, effect by effect, between which the size passes its target."""
    large = ~(sizes < targets)
    first = np.where(large.any(axis=0), large.argmax(axis=0), len(grid) - 1)
    columns = np.arange(grid.shape[1])
    return grid[np.maximum(first - 1, 0), columns], grid[first, columns]


def _between(grid: Array, sizes: Array, targets: Array) -> tuple[Array, list[float]]:
    """Share and expected size of every effect: interpolated in logarithms, never beyond the bounded runs."""
    shares, found = [], []
    for x, s, target in zip(grid.T, sizes.T, targets, strict=True):
        above = int(np.argmax(~(s < target))) if (~(s < target)).any() else len(s) - 1
        below = max(above - 1, 0)
        if np.isfinite(s[above]) and s[above] > s[below] > 0:
            part = float(np.clip(np.log(target / s[below]) / np.log(s[above] / s[below]), 0, 1))
            shares.append(x[below] + part * (x[above] - x[below]))
            found.append(float(s[below] * (s[above] / s[below]) ** part))
        else:
            shares.append(x[below])
            found.append(float(s[below]))
    return np.array(shares), found


def _planted(case: Case, drawn: list[dict], shares: Array) -> Case:
    return plant(case, drawn, shares, [d["scale"] for d in drawn])


def _targets(case: Case) -> Array:
    rng = generator(case.seed, case.number, case.attempt, 3)
    return np.array([np.exp(rng.uniform(*np.log(wish.sizes))) for wish in case.wishes])


def _details(case: Case, nominal: Mapping[str, Array]) -> list[dict]:
    """Source, shape and scale of every effect."""
    rng = generator(case.seed, case.number, case.attempt, 2)
    signals = {**nominal, **case.externals}
    out = []
    for wish in case.wishes:
        sourced = wish.effect in ("flexible_mode", "cross_coupling")
        sources = [s for s in wish.offer.sources if wish.effect == "flexible_mode" or s in case.externals]
        source = str(rng.choice(sources)) if sourced else None
        scale = _scale(
            signals[wish.offer.scale_of], signals[source] if source else None, wish.offer.is_rate, rng
        )
        change = str(rng.choice(wish.offer.changes)) if wish.offer.changes else None
        out.append(
            {
                "source": source,
                "scale": scale,
                "change": change,
                "shape": shape(wish.effect, scale, rng, wish.options),
            }
        )
    return out


def _scale(signal: Array, source: Array | None, is_rate: bool, rng: np.random.Generator) -> Scale:
    gap = 5
    first = (signal[gap:] - signal[:-gap]) / (gap * 1e-3)
    second = (first[gap:] - first[:-gap]) / (gap * 1e-3)
    peak, speed, push = (float(np.percentile(np.abs(x), 99.9)) + 1e-9 for x in (signal, first, second))
    windows = np.array([np.std(signal[i : i + 1000]) for i in range(0, ROWS - 1000, 250)])
    busiest = 0.25 * float(rng.choice(np.argsort(windows)[-len(windows) // 3 :]))
    other = float(np.percentile(np.abs(source), 99.9)) + 1e-9 if source is not None else 1.0
    return Scale(peak, peak if is_rate else speed, speed if is_rate else push, other, busiest)


def _starts(cases: Sequence[Case]) -> list[int]:
    counts = [1 + len(case.planted) for case in cases]
    return [sum(counts[:i]) for i in range(len(counts))]


def _measure(
    cases: Sequence[Case], steps: int, thin: bool = False
) -> tuple[dict[str, Array], list[list[dict]], list[int]]:
    """Runs, with a shadow lane for every effect left out; what each effect contributes where it is judged."""
    lanes, starts = [], _starts(cases)
    for case, start in zip(cases, starts, strict=True):
        lanes.append(lane(case))
        lanes.extend(lane(case, without=i, parent=start) for i in range(len(case.planted)))
    logs = simulate(cases[0].architecture, lanes, ROWS, steps, thin=thin)
    details = []
    for case, start in zip(cases, starts, strict=True):
        parts = []
        for i, effect in enumerate(case.planted):
            signal = effect.judged[0]
            full, without = logs[signal][:, start], logs[signal][:, start + 1 + i]
            parts.append(_contribution(case, case.wishes[i].sizes[0], signal, full, without))
        details.append(parts)
    return logs, details, starts


def _contribution(case: Case, least: float, signal: str, full: Array, without: Array) -> dict:
    with np.errstate(all="ignore"):
        noise = noise_rms(case, signal, full)
        difference = full - without
        if case.kind == "unknown" and np.isfinite(difference).all():
            columns = np.stack([without, np.gradient(without), np.ones(len(full))], axis=1)
            difference = difference - columns @ np.linalg.lstsq(columns, difference, rcond=None)[0]
        rms = float(np.sqrt(np.mean(difference**2)))
    return {"at": signal, "contribution_rms": rms, "noise_rms": noise, "size": rms / noise}


def noise_rms(case: Case, signal: str, values: Array) -> float:
    """Noise of a measured signal: its own; of an exact one what its block carries through; of a held one 0.1 %."""
    bench = case.architecture
    for noises in (case.inside, case.outside):
        if signal in noises:
            return float(np.sqrt(np.mean(noises[signal] ** 2)))
    if signal == bench.controller.command_signal:
        return HELD_SHARE * float(np.sqrt(np.mean(values**2))) + 1e-12
    block = next(b for b in bench.chain if any(o.signal == signal for o in b.outputs))
    out = next(o for o in block.outputs if o.signal == signal)
    A, B = block.system(case.truth)
    system = (
        np.array(A),
        np.array(B)[:, None],
        np.atleast_2d(out.C(case.truth)),
        np.array([[out.D(case.truth)]]),
    )
    Ad, Bd, Cd, Dd, _ = cont2discrete(system, 1e-3, "foh")
    poles = np.poly(Ad)
    zeros = np.poly(Ad - Bd @ Cd) + (Dd[0, 0] - 1) * poles
    noise = {**case.inside, **case.outside}[block.input]
    return float(np.std(lfilter(zeros, poles, noise)))
