"""An effect that was found, in its richer form: a delay that varies, friction that is largest at breakaway."""

import math

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import FIRST_NUMBER, Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.screen import base_of

__all__ = ["richer"]

Array = NDArray[np.float64]
LEAST_GAIN = 60.0
FASTEST = 10.0  # Hz of a delay's swing


def richer(case: Case, fitted: Fitted, *, least: float) -> list[tuple[Added, ...]]:
    """Hypotheses with one effect in its richer form, put last, where the residual speaks for at least χ² `least`."""
    found = []
    for place, one in enumerate(fitted.added):
        other = _varying(case, fitted, place, least) if one.kind == "delay" else _breaking_away(one)
        if other is not None:
            found.append((*fitted.added[:place], *fitted.added[place + 1 :], other))
    return found


def _breaking_away(one: Added) -> Added | None:
    if one.kind != "coulomb_friction":
        return None
    level, width = one.values["level"], one.values["smoothing"]
    values = {"level": 0.9 * level, "stiction": 1.5 * level, "speed": 8 * width, "smoothing": width}
    limits = {**one.limits, "speed": (width, 1e3 * width)}
    return Added("stribeck_friction", one.at, values, {}, frozenset(), limits)


def _varying(case: Case, fitted: Fitted, place: int, least: float) -> Added | None:
    """The swing about a fitted delay that takes most off, linear in sin and cos over a grid of frequencies."""
    path = f"effects.{FIRST_NUMBER + place}.delay"
    column = next(k for k, p in enumerate(fitted.parameters) if p.path == path)
    base = base_of(case, fitted)
    slope, time = -fitted.jacobian[:, column], case.rows.time
    best = (0.0, 0.0, np.zeros(2))
    frequency = 0.25 / case.duration
    while frequency < min(FASTEST, 0.05 / case.step):
        turn = 2 * math.pi * frequency * time
        columns = base.projected(np.stack([slope * np.sin(turn), slope * np.cos(turn)], axis=1))
        right = columns.T @ base.residual
        weights = np.linalg.lstsq(columns.T @ columns, right, rcond=None)[0]
        gain = float(weights @ right)
        best = max(best, (gain, frequency, weights), key=lambda b: b[0])
        frequency += max(0.2 / case.duration, 0.02 * frequency)
    gain, frequency, weights = best
    if gain < max(LEAST_GAIN, least):
        return None
    one = fitted.added[place]
    swing = float(np.hypot(*weights))
    values = {
        "mean": max(one.values["delay"], swing),
        "amplitude": swing,
        "frequency": frequency,
        "phase": float(np.arctan2(weights[1], weights[0])),
    }
    limits = {"phase": (-10.0, 10.0), "frequency": (0.5 * frequency, 2 * frequency)}
    return Added("variable_delay", one.at, values, {}, frozenset(), limits)
