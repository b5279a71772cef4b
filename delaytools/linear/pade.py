"""A rational approximation of a linear system with delay, only where one is asked for."""

from dataclasses import dataclass
from math import comb, factorial
from typing import final

import numpy as np

from delaytools.linear.algebra import append
from delaytools.linear.channel import Channel, Delay
from delaytools.linear.delay_system import DelaySystem, as_delay_system
from delaytools.linear.rational import Realisation, controllable_form
from delaytools.signals.trouble import AnalysisError

__all__ = ["PadeApproximation", "pade"]

_HOLDS_TO = 1.5  # omega tau / N up to which the phase of e^{-j omega tau} is right to 0.25 rad


@final
@dataclass(frozen=True, eq=False)
class PadeApproximation:
    """system: without channels; order: N; holds_to: rad/s, about 1.5 N / (largest delay), inf without delay."""

    system: DelaySystem
    order: int
    holds_to: float


def pade(system: DelaySystem, order: int) -> PadeApproximation:
    """Every channel replaced by its diagonal Pade approximation of order N.

    e^{-x} ~ p(-x)/p(x), p(x) = sum_k C(N,k) (2N-k)!/(2N)! x^k;  (1 - e^{-x})/x ~ (p(x) - p(-x))/(x p(x)).
    Raises AnalysisError for an order below 1, or where the approximated loop of direct gains is singular.
    Source: Golub & Van Loan, Matrix Computations, 11.3.1.
    """
    if order < 1:
        raise AnalysisError("a Pade approximation has order 1 or more", found=str(order))
    system = system.without_zero_delays()
    longest = max(system.delays, default=0.0)
    parts = [as_delay_system(_gain_free(channel, order)) for channel in system.channels]
    rational = _closed_by(system, append(*parts)) if parts else system
    return PadeApproximation(rational, order, _HOLDS_TO * order / longest if longest else np.inf)


def _closed_by(system: DelaySystem, parts: DelaySystem) -> DelaySystem:
    """The system with its channels w = Delta z replaced by the rational `parts`."""
    (ny, nu), m = system.shape, system.n_channels
    n = system.n_states
    rational = DelaySystem(
        A=system.A, B1=np.hstack([system.B1, system.B2]), B2=np.zeros((n, 0)),
        C1=np.vstack([system.C1, system.C2]), C2=np.zeros((0, n)),
        D11=np.block([[system.D11, system.D12], [system.D21, system.D22]]),
        D12=np.zeros((ny + m, 0)), D21=np.zeros((0, nu + m)), D22=np.zeros((0, 0)),
    )  # fmt: skip
    wires = np.zeros((nu + 2 * m, ny + 2 * m))
    wires[nu : nu + m, ny + m :] = np.eye(m)
    wires[nu + m :, ny : ny + m] = np.eye(m)
    into, out = np.eye(nu + 2 * m)[:, :nu], np.eye(ny + 2 * m)[:ny]
    closed = rational.appended(parts).connected(wires, into=into, out=out)
    return closed.named(inputs=system.inputs, outputs=system.outputs)


def _gain_free(channel: Channel, order: int) -> Realisation:
    """The channel's approximation, realised in x = s span and then scaled to s."""
    p = np.array([comb(order, k) * factorial(2 * order - k) / factorial(2 * order) for k in range(order + 1)])
    signs = (-1.0) ** np.arange(order + 1)
    numerator = p * signs if isinstance(channel, Delay) else (p - p * signs)[1:]
    form = controllable_form([list(numerator[::-1])], list(p[::-1]))
    return Realisation(form.A / channel.span, form.B / channel.span, form.C, form.D)
