"""Tune a design: its loop in one configuration against the loop that flies, by its own wishes."""

from delaytools.design.build import build, flight
from delaytools.design.design import Design
from delaytools.tuning.design_wishes import design_wishes
from delaytools.tuning.tune import Tuned, tune

__all__ = ["tune_design"]


def tune_design(design: Design, configuration: str | None, *, at: str, delay_at: str | None) -> Tuned:
    """What the design's [tuning] finds for a configuration, against the design's [flight]."""
    loop, flying = build(design, configuration), flight(design, configuration)
    return tune(loop, flying, wishes=design_wishes(design), at=at, delay_at=delay_at)
