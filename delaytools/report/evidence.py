"""What logs say of a design: a comparison, a diagnosis, and what the missing effects do to the margins."""

from dataclasses import dataclass
from typing import final

from delaytools.analysis.margins import Margins
from delaytools.analysis.questions import loop_margins
from delaytools.design.build import build
from delaytools.design.design import Design
from delaytools.diagnosis.answer import Diagnosis
from delaytools.diagnosis.improve import Addition, additions, improved
from delaytools.measurement.comparison import Comparison

__all__ = ["Evidence", "Improvement", "improvement"]


@final
@dataclass(frozen=True, eq=False)
class Evidence:
    """logs: their names. diagnosis None: none was made. configuration: that of the logs (None: the base)."""

    logs: tuple[str, ...]
    comparison: Comparison
    diagnosis: Diagnosis | None = None
    configuration: str | None = None


@final
@dataclass(frozen=True, eq=False)
class Improvement:
    """Margins of the design as it stands, and with everything that is certainly missing; both opened at one signal."""

    added: tuple[Addition, ...]
    before: Margins
    after: Margins


def improvement(design: Design, evidence: Evidence, at: str) -> Improvement | None:
    """What the missing effects do to the margins; None where nothing is certainly missing."""
    assert evidence.diagnosis is not None
    settings = {"logs": evidence.logs, "date": "", "configuration": evidence.configuration}
    added = additions(design, evidence.diagnosis, **settings)  # type: ignore[arg-type]
    if not added:
        return None
    new = improved(design, evidence.diagnosis, **settings)  # type: ignore[arg-type]
    before, after = (loop_margins(build(one, evidence.configuration), at).margins[0] for one in (design, new))
    return Improvement(added, before, after)
