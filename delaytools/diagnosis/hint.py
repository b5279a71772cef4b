"""What a residual that no known effect explains looks like: a suggestion in words, by sparse regression.

Only terms that a block bootstrap chooses again and again are suggested (stability selection, Meinshausen & Bühlmann
2010, J. R. Stat. Soc. B 72).
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.hint_terms import Ground, Way, ground, ways
from delaytools.estimation.least_squares import effective_number

__all__ = ["hint"]

Array = NDArray[np.float64]
RESAMPLES = 50
STABLE = 0.8  # of the resamples that choose a term
BLOCKS = 40
TERMS = 2
LEAST = 30.0  # χ² that a term must take off


def hint(case: Case, fitted: Fitted, exit_index: int) -> str:
    """Simple terms that the residual at an exit looks like, in words; "" where none is stable."""
    found = ground(case, fitted, exit_index)
    residual = _residual(case, fitted, exit_index)
    block = _blocks(case, exit_index)
    sums = [_sums(case, found, (way, exit_index), (residual, block)) for way in ways(case, exit_index)]
    best = max(sums, key=lambda one: one.chosen(one.all)[1])
    terms, _ = best.chosen(best.all)
    if not terms:
        return ""
    generator = np.random.default_rng(5)
    count: Counter[int] = Counter()
    for _ in range(RESAMPLES):
        times = np.bincount(
            generator.integers(0, len(best.grams), len(best.grams)), minlength=len(best.grams)
        )
        tried = [one.chosen(np.tensordot(times, one.grams, axes=1)) for one in sums]
        count.update(max(tried, key=lambda pair: pair[1])[0])
    stable = [k for k in terms if count[k] >= STABLE * RESAMPLES]
    return _told(case.exits[exit_index], best, stable, found.names, count) if stable else ""


def _residual(case: Case, fitted: Fitted, exit: int) -> Array:
    outputs = case.outputs(fitted.added, fitted.values)
    left = case.without_nuisance(tuple(m - y for m, y in zip(case.measured, outputs, strict=True)))
    return np.concatenate([case.whitening[exit].apply(rows[:, exit]) for rows in left])


def _blocks(case: Case, exit: int) -> NDArray[np.int64]:
    """(rows,) a number for every stretch of time of the exit's rows."""
    own = case.rows.exit == exit
    number = case.rows.blocks(case.duration / BLOCKS * (1 + 1e-9))[own]
    return np.asarray(np.unique(number, return_inverse=True)[1], dtype=np.int64)


@final
@dataclass(frozen=True, eq=False)
class _Sums:
    """Products of linear terms, terms and residual by block of time, for one way to the exit.

    grams (blocks, m, m), the residual last; first: number of linear terms; noise: variance of a row, raised where
    rows hang together.
    """

    way: Way
    grams: Array
    first: int
    noise: float
    scale: Array

    @property
    def all(self) -> Array:
        """Over all blocks."""
        return np.asarray(self.grams.sum(axis=0))

    def chosen(self, gram: Array) -> tuple[tuple[int, ...], float]:
        """Terms taken one after the other while each pays, and χ² that they and the linear terms take off together."""
        left = _without(gram, range(self.first))
        terms: list[int] = []
        for _ in range(TERMS):
            sizes = np.diag(left)[self.first : -1]
            known = sizes > 1e-4 * np.diag(gram)[self.first : -1]
            gains = np.where(known, left[self.first : -1, -1] ** 2 / np.where(known, sizes, 1.0), 0.0)
            best = int(np.argmax(gains))
            if gains[best] < LEAST * self.noise:
                break
            terms.append(best)
            left = _without(left, [self.first + best])
        return tuple(terms), float(gram[-1, -1] - left[-1, -1])

    def weights(self, terms: list[int]) -> Array:
        """The terms' factors, linear terms fitted beside them."""
        kept = [*range(self.first), *(self.first + k for k in terms)]
        gram = self.all
        found = np.linalg.lstsq(gram[np.ix_(kept, kept)], gram[kept, -1], rcond=1e-12)[0]
        return np.asarray(found[self.first :] / self.scale[[self.first + k for k in terms]])


def _without(gram: Array, columns: Iterable[int]) -> Array:
    """The products with what these columns explain taken out, one after the other."""
    left = gram.copy()
    for k in columns:
        if left[k, k] > 1e-9 * gram[k, k]:
            left = left - np.outer(left[:, k], left[k]) / left[k, k]
        left[k, :] = left[:, k] = 0.0
    return left


def _sums(case: Case, found: Ground, place: tuple[Way, int], rows: tuple[Array, NDArray[np.int64]]) -> _Sums:
    way, exit = place
    residual, block = rows
    whitened = [
        case.whitening[exit].apply(np.hstack([linear, way.carried(np.hstack([linear, terms]))]))
        for linear, terms in zip(found.linear, found.inside if way.at else found.shown, strict=True)
    ]
    columns = np.vstack(whitened)
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    every = np.column_stack([columns / size, residual])
    order = np.argsort(block, kind="stable")
    ends = np.searchsorted(block[order], np.arange(block.max() + 1))
    grams = np.stack([part.T @ part for part in np.split(every[order], ends[1:])])
    first = 2 * found.linear[0].shape[1]
    sums = _Sums(way, grams, first, 0.0, size)
    return _Sums(way, grams, first, _noise(sums, every), size)


def _noise(sums: _Sums, every: Array) -> float:
    """Variance of what the terms leave, raised by how its rows hang together."""
    terms = sums.chosen(sums.all)[0]
    kept = [*range(sums.first), *(sums.first + k for k in terms)]
    weights = np.linalg.lstsq(sums.all[np.ix_(kept, kept)], sums.all[kept, -1], rcond=1e-12)[0]
    left = every[:, -1] - every[:, kept] @ weights
    return float(np.var(left)) * len(left) / effective_number(left)


def _told(exit: str, sums: _Sums, stable: list[int], names: tuple[str, ...], count: Counter[int]) -> str:
    weights = sums.weights(stable)
    parts = [f"{weight:.2g}·{names[k]}" for weight, k in zip(weights, stable, strict=True)]
    share = min(count[k] for k in stable) / RESAMPLES
    formula = " + ".join(parts).replace("+ -", "- ")
    what = f"what {formula} at {sums.way.at} would do" if sums.way.at else formula
    return (
        f"the residual at {exit} looks like {what} (stable in {share:.0%} of resamples): a suggestion, not a finding"
    ).replace("%", " %")
