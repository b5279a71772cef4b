"""The answer of a diagnosis: what is missing, how sure, what the rivals are, and how the error falls."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, final

__all__ = [
    "Confusable", "Diagnosis", "Interrupted", "Missing", "NextExperiment", "Quantity", "Rival", "Step", "Unexplained",
]  # fmt: skip


@final
@dataclass(frozen=True)
class Quantity:
    """A fitted value with its standard error, both in `unit`."""

    value: float
    std: float
    unit: str = ""


@final
@dataclass(frozen=True)
class Missing:
    """An effect that the design lacks.

    effect: kind as a design file names it. at: port. signal: the measured signal at which it shows. parameters:
    fitted values. settings: what is no number (`source`) and smoothing widths. certain: no rival explains the logs as
    well, and what drives its segment is explained. also_at: other ports of the segment where it would do the same.
    """

    effect: str
    at: str
    signal: str
    parameters: Mapping[str, Quantity]
    settings: Mapping[str, Any] = field(default_factory=dict)
    certain: bool = True
    also_at: tuple[str, ...] = ()


@final
@dataclass(frozen=True)
class Rival:
    """A candidate after its fit. held_out_rms: whitened, 1 = noise. evidence: held-out χ² better (+) than no effect.

    delta_chi2: χ² worse than the best candidate. with_effects: what stood beside it in the fit.
    """

    effect: str
    at: str
    parameters: Mapping[str, Quantity]
    settings: Mapping[str, Any]
    held_out_rms: float
    evidence: float
    delta_chi2: float


@final
@dataclass(frozen=True)
class Confusable:
    """Effects that these logs cannot tell apart at a signal, the best first."""

    signal: str
    members: tuple[Rival, ...]


@final
@dataclass(frozen=True)
class Step:
    """One rung of the error ladder.

    step: what was added ("as designed", "tolerances fitted", "+ TYPE@PORT"). errors: signal -> held-out rms in the
    signal's unit. whitened: signal -> held-out whitened rms, 1 = noise.
    """

    step: str
    errors: Mapping[str, float]
    whitened: Mapping[str, float]


@final
@dataclass(frozen=True)
class Unexplained:
    """What no known effect explains at a signal: share of the mean square error left, bands (Hz), and a hint."""

    signal: str
    share_of_error: float
    bands: tuple[tuple[float, float], ...]
    hint: str

    @property
    def stretches(self) -> tuple[tuple[float, float], ...]:
        """The bands, in order, with those that touch joined."""
        found: list[tuple[float, float]] = []
        for low, high in sorted(self.bands):
            if found and low <= found[-1][1] * (1 + 1e-9):
                found[-1] = (found[-1][0], max(high, found[-1][1]))
            else:
                found.append((low, high))
        return tuple(found)


@final
@dataclass(frozen=True)
class NextExperiment:
    """The run that would decide between rivals: why, the input as [inputs] of a design writes it, and by how much."""

    why: str
    input: Mapping[str, Any]
    expected_delta_chi2: float


@final
@dataclass(frozen=True)
class Diagnosis:
    """What is missing from a design, by the logs.

    verdict: "adequate", "missing" or "unexplained". ranking: signal -> rivals, the best first. tolerated: fitted
    values inside their tolerance, by path. notes: what was said on the way (log notes, significant but small).
    seconds: the time that it took. interrupted: before every segment was searched, which `notes` name.
    ladder_bands: per rung, signal -> 95 % block-bootstrap limits of its whitened rms.
    """

    verdict: str
    missing: tuple[Missing, ...]
    ranking: Mapping[str, tuple[Rival, ...]]
    confusable: tuple[Confusable, ...]
    ladder: tuple[Step, ...]
    unexplained: tuple[Unexplained, ...]
    next_experiment: NextExperiment | None
    tolerated: Mapping[str, Quantity]
    notes: tuple[str, ...]
    budget_exhausted: bool
    seconds: float
    interrupted: bool = False
    ladder_bands: tuple[Mapping[str, tuple[float, float]], ...] = ()


@final
class Interrupted(KeyboardInterrupt):
    """An interrupt while segments were searched; `answer`: what the finished ones say."""

    def __init__(self, answer: Diagnosis) -> None:
        super().__init__()
        self.answer = answer
