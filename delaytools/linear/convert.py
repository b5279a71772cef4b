"""To and from python-control: the doors of the exact-delay algebra."""

from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from delaytools.linear.delay_system import DelaySystem, as_delay_system
from delaytools.signals.response import Response
from delaytools.signals.trouble import AnalysisError

__all__ = ["frequency_data", "from_control", "response_of", "to_control"]


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


def frequency_data(system: Any, omega: ArrayLike) -> control.FrequencyResponseData:
    """G(jω) at the frequencies omega (n,) in rad/s, exact with its delays, as python-control's frequency data.

    Margins, plots and products of python-control take it. Raises AnalysisError where `system` is no linear system.
    """
    whole, at = as_delay_system(system), np.atleast_1d(np.asarray(omega, dtype=float))
    return control.frd(np.moveaxis(whole.frequency_response(at), 0, -1), at)


def response_of(data: control.FrequencyResponseData, input: int = 0, output: int = 0) -> Response:
    """One channel of frequency data, measured or computed, as `fit` takes it."""
    at = np.asarray(data.omega, dtype=float)
    order = np.argsort(at)
    names = str(data.input_labels[input]), str(data.output_labels[output])
    return Response(at[order], np.asarray(data.frdata[output, input], dtype=complex)[order], *names)
