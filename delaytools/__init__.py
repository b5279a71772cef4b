"""Delay in hardware-in-the-loop benches: exact margins, compensators, nonlinear runs, missing effects.

Names are loaded when they are first used, so that `delaytools --help` answers at once.
"""

import importlib
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "Record": "signals.record",
    "DelaytoolsError": "signals.trouble",
    "DelaySystem": "linear.delay_system",
    "delay": "linear.algebra",
    "feedback": "linear.algebra",
    "pade": "linear.pade",
    "Loop": "loop.loop",
    "linearise": "loop.linearise",
    "Design": "design.design",
    "parse_design": "design.design",
    "read_design": "design.file",
    "write_design": "design.file",
    "build": "design.build",
    "design_stimuli": "design.stimuli",
    "loop_margins": "analysis.questions",
    "loop_roots": "analysis.questions",
    "transfer": "analysis.questions",
    "limit_cycles": "analysis.limit_cycles",
    "margins": "analysis.margins",
    "sweep_margins": "analysis.delay_sweep",
    "step_response": "analysis.time_response",
    "forced_response": "analysis.time_response",
    "rightmost_roots": "analysis.characteristic_roots",
    "flight": "design.build",
    "simulate": "simulation.simulate",
    "fit": "estimation.low_order",
    "tune_design": "tuning.tune_design",
    "write_report": "report.write",
    "read_log": "measurement.log_file",
    "write_log": "measurement.log_file",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'delaytools' has no attribute {name!r}")
    return getattr(importlib.import_module(f"delaytools.{_PUBLIC[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
