"""An effect that was found, in its richer form: a delay that varies, friction that is largest at breakaway."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.added import Added, path_of
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis
from delaytools.diagnosis.screen import Base, base_of, response_instead
from delaytools.diagnosis.swings import with_swing
from delaytools.loop.port import find_port
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["breaking_away_as_well", "plainer", "richer"]

Array = NDArray[np.float64]
LEAST_GAIN = 40.0
FASTEST = 10.0  # Hz of a delay's swing
STICTION = 1.3  # times the level: size at which the direction of a larger breakaway force is taken
CLEARLY = 1.5  # times the level: a breakaway force that is clearly another one
FASTER = 1.0  # times the speeds seen: force that falls beyond them is not seen to fall
BEYOND = 1.5  # the same, where it is fitted: as seen beside another hypothesis they are not sharp
SLOW = 0.3  # times these: a force that falls up to there is seen in what a slow motion does, where that is told at all
APART = 0.2  # of the Coulomb level: by how much it may miss lying between the forces at speed and at breakaway
SPEEDS = (3.0, 8.0, 25.0, 80.0)  # times the smoothing width


def richer(case: Case, fitted: Fitted, *, least: float) -> list[tuple[Added, ...]]:
    """Hypotheses with one effect in its richer form, put last, where the residual speaks for at least χ² `least`."""
    ways = {"delay": _varying, "coulomb_friction": _breaking_away}
    places = [place for place, one in enumerate(fitted.added) if one.kind in ways]
    if not places:
        return []
    base, found = base_of(case, fitted), []
    for place in places:
        other = ways[fitted.added[place].kind](base, place, least)
        if other is not None:
            other = replace(other, rank=fitted.added[place].rank)
            found.append((*fitted.added[:place], *fitted.added[place + 1 :], other))
    return found


def plainer(fitted: Fitted) -> tuple[Added, ...] | None:
    """The hypothesis with every varying delay as a constant one; None where it has none."""
    if all(one.kind != "variable_delay" for one in fitted.added):
        return None
    return tuple(
        Added("delay", one.at, {"delay": one.values["mean"]}, rank=one.rank) if one.kind == "variable_delay" else one
        for one in fitted.added
    )


def breaking_away_as_well(case: Case, fitted: Fitted, place: int) -> Fitted | None:
    """The hypothesis with Coulomb friction as friction that is clearly larger at breakaway, put last.

    By half at least, and up to speeds that the log resolves well, or up to those of a slow motion: where that explains
    the log as well, the log does not tell the two apart.
    """
    one = fitted.added[place]
    level, width = one.values["level"], one.values["smoothing"]
    fastest = FASTER * base_of(case, fitted).view.state(find_port(case.segment.loop, one.at))
    if fastest <= 0:
        return None
    slowest = min(SPEEDS[1] * width, SLOW * fastest)
    limits = {
        **one.limits,
        "level": (0.0, level), "stiction": (CLEARLY * level, np.inf), "speed": (slowest, fastest),
    }  # fmt: skip
    values = {"level": 0.9 * level, "stiction": 1.05 * CLEARLY * level, "smoothing": width}
    values["speed"] = 0.5 * (slowest + fastest)
    richer_one = Added("stribeck_friction", one.at, values, {}, frozenset(), limits, rank=one.rank)
    try:
        return fit_hypothesis(case, (*fitted.added[:place], *fitted.added[place + 1 :], richer_one), near=fitted)
    except (DelaytoolsError, np.linalg.LinAlgError):  # no run with it ends: no rival
        return None


def _breaking_away(base: Base, place: int, least: float) -> Added | None:
    """Friction that is larger at breakaway, at the speed over which it falls that takes most off."""
    one = base.fitted.added[place]
    level, width = one.values["level"], one.values["smoothing"]
    fastest = max(BEYOND * base.view.state(find_port(base.case.segment.loop, one.at)), 2 * width)
    between = {"level": (0.0, (1 + APART) * level), "stiction": ((1 - APART) * level, np.inf)}
    limits = {**one.limits, **between, "speed": (width, fastest)}
    best, most = None, max(LEAST_GAIN, least)
    for speed in SPEEDS:
        values = {"level": level, "stiction": STICTION * level, "speed": speed * width, "smoothing": width}
        richer_one = Added("stribeck_friction", one.at, values, {}, frozenset(), limits)
        change = response_instead(base, place, richer_one)
        gain, scale = (0.0, 0.0) if change is None else base.gain(change, 0.0, 10.0)
        if gain > most:
            best, most = richer_one.moved({"stiction": level * (1 + scale * (STICTION - 1))}), gain
    return best


def _varying(base: Base, place: int, least: float) -> Added | None:
    """The swing about a fitted delay that takes most off, linear in sin and cos over a grid of frequencies."""
    case, fitted = base.case, base.fitted
    path = path_of(place, "delay")
    column = next(k for k, p in enumerate(fitted.parameters) if p.path == path)
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
    return with_swing(one.at, values)
