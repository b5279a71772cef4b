"""The answer of a comparison: model against measurement, signal by signal, and where it fails."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ClosedLoop",
    "Comparison",
    "Figures",
    "LevelShare",
    "Shift",
    "SignalComparison",
    "Strips",
    "Theil",
]

Array = NDArray[np.float64]


@final
@dataclass(frozen=True)
class Theil:
    """Theil's inequality coefficient, rms(y - ŷ)/(rms y + rms ŷ), and the shares of the mean square error.

    bias: of the mean (offset). variance: of the spread (gain). covariance: the rest (timing, noise). They add to 1.
    """

    coefficient: float | None
    bias: float | None
    variance: float | None
    covariance: float | None


@final
@dataclass(frozen=True)
class Shift:
    """The pure time shift of the model that fits best, in s (> 0: the measurement comes later); rms before, after."""

    seconds: float | None
    error_before: float | None
    error_after: float | None


@final
@dataclass(frozen=True)
class Figures:
    """Figures of one log, or of all logs as one. A figure that has no value is None, and `why` says why by its name."""

    log: str
    rms_error: float | None
    fit_percent: float | None
    theil: Theil
    shift: Shift
    why: Mapping[str, str] = field(default_factory=dict)


@final
@dataclass(frozen=True)
class LevelShare:
    """The share of the squared error while `quantity` of the model's signal lies in [low, high], of the time there."""

    quantity: str
    low: float
    high: float
    unit: str
    share: float
    share_of_time: float


@final
@dataclass(frozen=True, eq=False)
class Strips:
    """The squared error spread out: edges (k + 1) and shares (k) over time (s) and frequency (Hz).

    Several logs stand one after the other in time. coherence, noise_share: per frequency band. levels: every level bin.
    """

    time_edges: Array
    time_shares: Array
    band_edges: Array
    band_shares: Array
    coherence: Array
    noise_share: Array
    levels: tuple[LevelShare, ...]


@final
@dataclass(frozen=True, eq=False)
class SignalComparison:
    """One measured signal against the model of its segment, driven by what was measured at its entries.

    noise_rms: of the signal itself, without a model. carried_noise_rms: what the noise of measured inputs sends
    through the segment. explained_rms: both together, and rounding. difference_rms: error beyond that.
    verdict: "adequate" or "fails"; reason in words. worst_times: (from, to, share); worst_bands: (from, to, share,
    coherence). traces: per log (time, measured, model), the model NaN in rows that do not count.
    """

    signal: str
    unit: str
    driven_by: tuple[str, ...]
    blocks: tuple[str, ...]
    overall: Figures
    logs: tuple[Figures, ...]
    noise_rms: float | None
    carried_noise_rms: float
    explained_rms: float
    difference_rms: float
    verdict: str
    reason: str
    worst_times: tuple[tuple[float, float, float], ...]
    worst_bands: tuple[tuple[float, float, float, float | None], ...]
    worst_levels: tuple[LevelShare, ...]
    strips: Strips
    traces: tuple[tuple[Array, Array, Array], ...]

    @property
    def rms_error(self) -> float | None:
        """rms of measured minus model over all logs, in the signal's unit."""
        return self.overall.rms_error


@final
@dataclass(frozen=True)
class ClosedLoop:
    """The whole loop run from a log's external inputs alone: signal -> (rms error, fit %).

    why: where that says little or nothing, in words.
    """

    log: str
    figures: Mapping[str, tuple[float, float | None]]
    why: str


@final
@dataclass(frozen=True, eq=False)
class Comparison:
    """Model against measurement.

    signals: in signal order. where: the first that fails, in words. not_compared: signal -> why. notes: what else
    should be known (nothing was fitted, inputs that no column drives).
    """

    signals: tuple[SignalComparison, ...]
    where: str
    closed_loop: tuple[ClosedLoop, ...]
    not_compared: Mapping[str, str]
    notes: tuple[str, ...]

    @property
    def adequate(self) -> bool:
        """Whether no signal fails."""
        return all(one.verdict == "adequate" for one in self.signals)

    def __getitem__(self, signal: str) -> SignalComparison:
        return next(one for one in self.signals if one.signal == signal)
