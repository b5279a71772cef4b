"""Judged on data not used for the fit: two folds of time blocks, or of logs, each fitting and each judging."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.case import Rows
from delaytools.diagnosis.fitting import Fitted

__all__ = ["HeldOut", "folds_of", "held_out", "rms_band"]

Array = NDArray[np.float64]
BLOCKS = 20
MANY = 5  # logs
TELLING, SHORTEST = 0.05, 10  # of what tells a value apart that each fold must hold, and rows of a block at least
RANK = 1e-6  # of the largest singular value: what is smaller tells nothing
PIECE, DRAWN = 0.25, 1000  # s of a block, and resamples of a block bootstrap


@final
@dataclass(frozen=True, eq=False)
class HeldOut:
    """Held-out residuals (rows,) of a hypothesis, and χ² by block of time."""

    residual: Array
    blocks: Array

    @property
    def chi2(self) -> float:
        """Σ of the squared held-out residuals."""
        return float(self.residual @ self.residual)

    def better_than(self, other: "HeldOut") -> tuple[float, float]:
        """χ² by which this is better than another, and the standard error of that over blocks."""
        change = other.blocks - self.blocks
        return float(change.sum()), float(np.sqrt(len(change)) * change.std(ddof=1)) if len(
            change
        ) > 1 else np.inf

    def luck_beside(self, other: "HeldOut") -> float:
        """How far chance moves the χ² by which this is better than another: from the rows in which it is worse."""
        change = other.residual**2 - self.residual**2
        return float(np.sqrt(2 * np.sum(np.minimum(change, 0.0) ** 2)))


def folds_of(rows: Rows) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """(rows,) whether a row is in the first fold, and its block; logs are folds where there are several.

    Many logs are blocks, too: what differs from run to run is no less than what differs within one.
    """
    if rows.log.max(initial=0) + 1 >= MANY:
        return rows.log % 2 == 0, rows.log
    length = float(rows.time.max()) * (1 + 1e-9) + 1e-9
    blocks = rows.blocks(length / BLOCKS)
    if rows.log.max(initial=0) > 0:
        return rows.log % 2 == 0, blocks
    return blocks % 2 == 0, blocks


def _telling_folds(rows: Rows, slopes: Array) -> NDArray[np.bool_]:
    """(rows,) the first fold: blocks of time, halved until both folds tell every mix of the values; slopes (rows, k).

    A mode that rings at the start of a log and never again would be fitted where it is not. Where no such folds are,
    those of `folds_of`. With slopes = Q R, the eigenvalues of QᵀQ over a fold's rows are its shares.
    """
    plain, _ = folds_of(rows)
    sides, sizes, _ = np.linalg.svd(slopes, full_matrices=False)
    sides = sides[:, sizes > RANK * sizes[0]]
    step = float(np.median(np.diff(rows.time[(rows.log == 0) & (rows.exit == 0)])))
    first, length = plain, float(rows.time.max()) / BLOCKS
    while not _tells(sides, first):
        length /= 2
        if length < SHORTEST * step:
            return plain
        first = rows.blocks(length) % 2 == 0
    return first


def _tells(sides: Array, fold: NDArray[np.bool_]) -> bool:
    """Whether a fold and the rest both hold enough of what tells each mix of values apart; sides (rows, k): Q."""
    shares = np.linalg.eigvalsh(sides[fold].T @ sides[fold])
    return bool(shares.min() >= TELLING and shares.max() <= 1 - TELLING)


def held_out(fitted: Fitted, rows: Rows) -> HeldOut:
    """Residuals of each fold by the values that fit the other one, by one Gauss–Newton step from the common fit."""
    _, blocks = folds_of(rows)
    residual = fitted.residual.copy()
    slopes = fitted.jacobian
    useful = np.abs(slopes).max(axis=0, initial=0.0) > 0
    J = slopes[:, useful & fitted.inside] if fitted.parameters else slopes
    if J.shape[1]:
        J = J / np.linalg.norm(J, axis=0)
        first = _telling_folds(rows, J)
        for fold in (first, ~first):
            if 0 < fold.sum() < len(fold):
                left = J[fold].T @ J[fold]
                ridge = 1e-6 * np.eye(len(left))
                move = -np.linalg.solve(left + ridge, J[fold].T @ fitted.residual[fold])
                residual[~fold] = fitted.residual[~fold] + J[~fold] @ move
    return HeldOut(residual, np.bincount(blocks, residual**2))


def rms_band(rows: Array, blocks: NDArray[np.int64], *, seed: int = 1) -> tuple[float, float]:
    """95 % limits of the rms of rows (n,): percentiles over resampled blocks (Künsch 1989), noise being coloured."""
    _, place = np.unique(blocks, return_inverse=True)
    power, count = np.bincount(place, rows**2), np.bincount(place)
    drawn = np.random.default_rng(seed).integers(0, len(power), (DRAWN, len(power)))
    low, high = np.percentile(np.sqrt(power[drawn].sum(axis=1) / count[drawn].sum(axis=1)), [2.5, 97.5])
    return float(low), float(high)
