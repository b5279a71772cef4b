"""To and from python-control: the doors of the exact-delay algebra."""

from typing import Any

import control

from delaytools.linear.delay_system import DelaySystem, as_delay_system
from delaytools.signals.trouble import AnalysisError

__all__ = ["from_control", "to_control"]


def from_control(system: Any) -> DelaySystem:
    """A DelaySystem without channels from a control.TransferFunction or StateSpace, a number or a matrix.

    Continuous time only. Raises AnalysisError for discrete time, improper or complex systems.
    """
    return as_delay_system(system)


def to_control(system: DelaySystem) -> control.StateSpace:
    """control.StateSpace of a system without delay: x' = A x + B1 u, y = C1 x + D11 u.

    Raises AnalysisError where channels are left: python-control has no exact delay.
    """
    system = system.without_zero_delays()
    if system.channels:
        spans = ", ".join(f"{span:g} s" for span in system.delays)
        raise AnalysisError(
            "python-control has no exact delay",
            found=f"channels of {spans}",
            advice="ask for a rational approximation: to_control(pade(system, order).system)",
        )
    return control.ss(
        system.A, system.B1, system.C1, system.D11, inputs=list(system.inputs), outputs=list(system.outputs)
    )
