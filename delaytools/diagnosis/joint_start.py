"""Where the fit of one effect more begins: what was fitted before makes room for it."""

from dataclasses import replace

import numpy as np

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.fitting import Fitted, placed
from delaytools.diagnosis.screen import Base, response

__all__ = ["making_room"]

WORTHWHILE = 0.1  # of a value: a smaller move is left to the fit


def making_room(base: Base, one: Added) -> tuple[tuple[Added, ...], Fitted] | None:
    """The hypothesis with one effect more and the fitted values that go best with its start, to first order.

    None where these hardly move.
    """
    fitted, change = base.fitted, response(base, one)
    if change is None or not fitted.jacobian.shape[1]:
        return None
    slopes = fitted.jacobian
    norms = np.linalg.norm(slopes, axis=0)
    useful = norms > 0
    moves = np.zeros(slopes.shape[1])
    moves[useful] = np.linalg.lstsq(slopes[:, useful] / norms[useful], change, rcond=1e-6)[0] / norms[useful]
    parameters = tuple(
        replace(p, value=float(np.clip(p.value + move, p.low, p.high)))
        for p, move in zip(fitted.parameters, moves, strict=True)
    )
    pairs = zip(parameters, fitted.parameters, strict=True)
    if not any(abs(new.value - old.value) > WORTHWHILE * abs(old.value) for new, old in pairs):
        return None
    moved = placed(fitted.added, parameters)
    return (*moved, one), replace(fitted, added=moved, parameters=parameters)
