"""The second-order lag that gives a record's output from its input, by output error in time."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.estimation.least_squares import Estimate, estimate
from delaytools.estimation.second_order_response import Drive, drive, responses
from delaytools.signals.parameter import Parameter
from delaytools.signals.record import Record
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["fit_rows"]

RealArray = NDArray[np.float64]
_ROWS = 2000  # used to look for starts
_DAMPING = (0.05, 0.3, 1.0)
_REFINED = 3


@final
@dataclass(frozen=True, eq=False)
class _Rows:
    time: RealArray
    u: RealArray
    y: RealArray
    held: bool

    def driven(self, delay: float) -> Drive:
        """What drives the model behind a delay."""
        return drive(self.time, self.u, delay, self.held)


def _model(w: float, zeta: float, driven: Drive) -> RealArray:
    """(n,3): to the input from rest, to the output at the first row, and to its rate in units of ω there."""
    return responses(w, zeta, driven) * np.array([1.0, 1.0, w])


def fit_rows(record: Record, input: str, output: str, *, delay: bool) -> tuple[Estimate, float]:
    """The estimate of (natural_frequency, damping, gain, delay) and of the first row's state, and its cost.

    Starts: every combination of a grid of ω, ζ and τ, the rest by linear least squares; the best three are refined.
    """
    rows = _Rows(record.time, record[input], record[output], input in record.held)
    _check(rows, input, output)
    found = [estimate(_residual(rows), start) for start in _starts(rows, delay)]
    best = min(found, key=lambda item: item.cost)
    return best, 2 * best.cost / float(np.sum((rows.y - rows.y.mean()) ** 2))


def _check(rows: _Rows, input: str, output: str) -> None:
    if len(rows.time) < 20:
        raise DelaytoolsError("too few rows for a fit", found=f"{len(rows.time)}", advice="give at least 20")
    for name, values in ((input, rows.u), (output, rows.y)):
        if not np.all(np.isfinite(values)):
            raise DelaytoolsError("a signal is not finite", where=name, advice="cut out the gaps")
        if np.ptp(values) == 0:
            raise DelaytoolsError("a signal never moves: nothing can be fitted", where=name)


def _residual(rows: _Rows) -> Callable[[RealArray], RealArray]:
    def residual(x: RealArray) -> RealArray:
        w, zeta, gain, delay, first, rate = x
        return np.asarray(_model(w, zeta, rows.driven(delay)) @ np.array([gain, first, rate]) - rows.y)

    return residual


def _starts(rows: _Rows, delay: bool) -> list[list[Parameter]]:
    """Parameters at the best points of the grid, with the linear ones solved for."""
    step, span = float(np.median(np.diff(rows.time))), float(rows.time[-1] - rows.time[0])
    low, high = 2 * np.pi / span, np.pi / step
    most = span / 4 if delay else 0.0
    few = _Rows(rows.time[:_ROWS], rows.u[:_ROWS], rows.y[:_ROWS], rows.held)
    if np.ptp(few.u) == 0:
        few = rows
    delays = [0.0, *np.geomspace(2 * step, most, 8)] if delay else [0.0]
    grid = list(product(np.geomspace(low, 0.8 * high, 24), _DAMPING, delays))
    driven = {tau: few.driven(tau) for tau in delays}
    ranked = sorted(((*_linear(few.y, w, z, driven[tau]), (w, z, tau)) for w, z, tau in grid), key=lambda item: item[0])
    found, reach = [], 1e3 * float(np.ptp(rows.y))
    for _, linear, (w, zeta, tau) in ranked[:_REFINED]:
        found.append(
            [
                Parameter("natural_frequency", float(w), "rad/s", low / 4, high),
                Parameter("damping", float(zeta), "", 0.0, 20.0),
                Parameter("gain", float(linear[0])),
                Parameter("delay", float(tau), "s", 0.0, most, fixed=not delay),
                Parameter("initial_output", float(np.clip(linear[1], -reach, reach)), "", -reach, reach),
                Parameter("initial_rate", float(np.clip(linear[2], -reach, reach)), "", -reach, reach),
            ]
        )
    return found


def _linear(y: RealArray, w: float, zeta: float, driven: Drive) -> tuple[float, RealArray]:
    """Σ r² with the best gain and first state, and these."""
    basis = _model(w, zeta, driven)
    if not np.all(np.isfinite(basis)):
        return np.inf, np.zeros(3)
    best = np.linalg.lstsq(basis, y, rcond=1e-10)[0]
    return float(np.sum((basis @ best - y) ** 2)), np.asarray(best, dtype=float)
