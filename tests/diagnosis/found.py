"""Diagnoses written by hand, for what is done with one: improve, the command line, the report."""

from typing import Any

from delaytools.diagnosis.answer import (
    Confusable,
    Diagnosis,
    Missing,
    NextExperiment,
    Quantity,
    Rival,
    Step,
    Unexplained,
)

__all__ = ["DEAD_BAND", "DELAY", "SLOWER", "diagnosis"]

DEAD_BAND = Missing("dead_band", "actuator.input", "fin", {"half_width": Quantity(0.10034, 0.00071, "deg")})
DELAY = Missing("delay", "gyro.input", "sensed", {"delay": Quantity(0.0070123, 0.000021, "s")}, certain=False)
SLOWER = Missing(
    "parameter_change:natural_frequency",
    "actuator",
    "fin",
    {"natural_frequency": Quantity(81.234, 0.31, "rad/s")},
)
LAG = Rival("lag", "gyro.input", {"time_constant": Quantity(0.0069, 0.0001, "s")}, {}, 1.04, 812.0, 9.0)
LATE = Rival("delay", "gyro.input", DELAY.parameters, {}, 1.01, 830.0, 0.0)


def diagnosis(*missing: Missing, **more: Any) -> Diagnosis:
    """A diagnosis with these effects, its ladder falling by each; `more` replaces other fields."""
    signals = {"fin": 0.1, "sensed": 0.9}
    steps = [Step("as designed", dict(signals), {"fin": 10.0, "sensed": 18.0})]
    for one in missing:
        signals[one.signal] = {"fin": 0.0101, "sensed": 0.0507}[one.signal]
        steps.append(Step(f"+ {one.effect}@{one.at}", dict(signals), {"fin": 1.01, "sensed": 1.01}))
    answer: dict[str, Any] = {
        "verdict": "missing" if missing else "adequate", "missing": missing, "ranking": {"sensed": (LATE, LAG)},
        "confusable": (), "ladder": tuple(steps), "unexplained": (), "next_experiment": None, "tolerated": {},
        "notes": (), "budget_exhausted": False, "seconds": 1.5,
    }  # fmt: skip
    return Diagnosis(**{**answer, **more})


OPEN: dict[str, Any] = {
    "confusable": (Confusable("sensed", (LATE, LAG)),),
    "unexplained": (Unexplained("rate", 0.12, ((3.0, 9.0),), "the residual goes with v·|v|"),),
    "next_experiment": NextExperiment(
        "a higher frequency tells delay from lag",
        {"type": "sine", "amplitude": "1 deg", "frequency": "20 Hz"},
        400.0,
    ),
}
