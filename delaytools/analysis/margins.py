"""Exact margins of a loop opened at one signal: negative feedback, closed loop 1 + L = 0."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, final

import numpy as np

from delaytools.analysis.curve import Curve, RealArray, features_of, traced
from delaytools.analysis.margin_table import MarginTable, margin_table
from delaytools.analysis.quick_response import quick_response
from delaytools.analysis.stability import is_stable
from delaytools.linear.channel import Hold
from delaytools.linear.delay_system import DelaySystem

__all__ = [
    "Crossing",
    "Labels",
    "Margins",
    "Sampling",
    "curve_of",
    "labels_of",
    "margins",
    "margins_of_table",
]

Sampling = Literal["exact", "continuous approximation"]


@final
@dataclass(frozen=True)
class Crossing:
    """One crossing of L: `gain`: |L| = 1, margin = phase margin in rad; `phase`: L < 0, margin = the factor 1/|L|.

    frequency in rad/s (0 and inf included); gain |L|; phase arg L in (-π, π].
    """

    kind: Literal["gain", "phase"]
    frequency: float
    gain: float
    phase: float
    margin: float


@final
@dataclass(frozen=True)
class Margins:
    """Margins of the closed loop at an extra delay of `delay` s; None where `why` says why.

    gain_margin: the factor nearest 1 in log at which stability is lost; phase_margin in rad, (-π, π];
    delay_margin in s; modulus_margin min |1+L|; disk_margin α of MATLAB, σ = 0; frequencies in rad/s.
    why: {name: "never" or "closed loop unstable"} for each None.
    """

    delay: float
    stable: bool
    gain_margin: float | None
    gain_margin_frequency: float | None
    phase_margin: float | None
    phase_margin_frequency: float | None
    delay_margin: float | None
    modulus_margin: float | None
    disk_margin: float | None
    crossings: tuple[Crossing, ...]
    sampling: Sampling
    linearised_without: tuple[str, ...] = ()
    why: dict[str, str] = field(default_factory=dict)


@final
@dataclass(frozen=True)
class Labels:
    """What every answer says of its model: how sampling was treated, which effects were taken out."""

    sampling: Sampling | None = None
    linearised_without: tuple[str, ...] = ()


def margins(L: DelaySystem, labels: Labels | None = None) -> Margins:
    """The margins of the open loop L (one input, one output) under negative feedback; exact with its delays.

    Stability is a certified count of the roots of 1 + L(s) = 0 in Re s >= 0, never read off the margins.
    labels.sampling None: "exact" unless L holds the continuous approximation of a hold.
    Raises AnalysisError where L is not single-input single-output or 1 + L(∞) = 0.
    """
    table = margin_table(curve_of(L), np.zeros(1))
    stable = is_stable(L, float(table.modulus_margin[0]))
    return margins_of_table(table, [stable], labels_of(L, labels))[0]


def labels_of(L: DelaySystem, labels: Labels | None) -> Labels:
    """The labels with the treatment of sampling filled in."""
    labels = labels or Labels()
    held = any(isinstance(channel, Hold) for channel in L.channels)
    return Labels(
        labels.sampling or ("continuous approximation" if held else "exact"), labels.linearised_without
    )


def curve_of(L: DelaySystem, delays: RealArray | None = None) -> Curve:
    """The frequency response of L, resolved for the series `delays` in s too."""
    return traced(quick_response(L), features_of(L), extra=delays)


def margins_of_table(table: MarginTable, stable: Sequence[bool], labels: Labels) -> tuple[Margins, ...]:
    """One record for each delay of the table."""
    numbers = np.stack([getattr(table, name) for name in _VALUES]).T.tolist()
    listed = _listed(table)
    delays = table.delays.tolist()
    return tuple(
        _record(delays[i], bool(stable[i]), dict(zip(_VALUES, numbers[i], strict=True)), listed[i], labels)
        for i in range(len(delays))
    )


_FREQUENCIES = {"gain_margin_frequency": "gain_margin", "phase_margin_frequency": "phase_margin"}
_VALUES = (
    "gain_margin", "gain_margin_frequency", "phase_margin", "phase_margin_frequency",
    "delay_margin", "modulus_margin", "disk_margin",
)  # fmt: skip


def _record(
    delay: float, stable: bool, values: dict[str, float], crossings: tuple[Crossing, ...], labels: Labels
) -> Margins:
    """None and the reason where the loop is unstable already or the margin is infinite."""
    kept: dict[str, float | None] = {}
    why: dict[str, str] = {}
    for name, value in values.items():
        missing = "closed loop unstable" if not stable else "never"
        infinite = values[_FREQUENCIES.get(name, name)] == np.inf
        kept[name] = None if not stable or infinite else value
        if kept[name] is None:
            why[name] = missing
    return Margins(
        delay=delay, stable=stable, crossings=crossings, sampling=labels.sampling or "exact",
        linearised_without=labels.linearised_without, why=why, **kept,
    )  # fmt: skip


def _listed(table: MarginTable) -> list[tuple[Crossing, ...]]:
    """The crossings of each delay, by rising frequency."""
    omega = table.gains.omega.tolist()
    found: list[list[Crossing]] = [
        [
            Crossing("gain", w, 1.0, a - np.pi if a > 0 else a + np.pi, a)
            for w, a in zip(omega, angles, strict=True)
        ]
        for angles in table.phases.tolist()
    ]
    rows = zip(
        table.listed.index.tolist(), table.listed.omega.tolist(), table.listed.gain.tolist(), strict=True
    )
    for i, w, gain in rows:
        found[i].append(Crossing("phase", w, gain, np.pi, 1.0 / gain))
    return [tuple(sorted(crossings, key=lambda c: c.frequency)) for crossings in found]
