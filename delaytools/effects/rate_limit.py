"""A limit on speed: of a signal, or of a second-order element itself."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.rate_limiter import RateLimiter
from delaytools.effects.effect import Effect, Knowledge, Place, act_at, insert_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import LIMIT, Modifier, StateView

__all__ = ["RateLimitEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class SpeedLimit(Modifier):
    """position' = clip(v, ±limit); v' = 0 where abs(v) ≥ limit and v' pushes outwards.

    A step of finite length carries v past the limit, where the exact v never is; there v' = (clip(v) - v) / settling
    brings it back (s; some frames), so that v leaves the limit in time when the push turns round.
    """

    state: str
    settling: float
    limit: Scalar = value("rate", low=0.0, neutral=math.inf)

    stage = LIMIT
    sources = ()
    amplitude_dependent = True

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        rate, pushed = view.states[self.state], view.rates[self.state]
        above = ca.logic_and(rate >= self.limit, pushed > 0)
        below = ca.logic_and(rate <= -self.limit, pushed < 0)
        clipped = ca.fmax(ca.fmin(rate, self.limit), -self.limit)
        held = (clipped - rate) / self.settling
        return {view.position: clipped, self.state: ca.if_else(ca.logic_or(above, below), held, pushed)}


@final
@dataclass(frozen=True, kw_only=True)
class RateLimitEffect(Effect):
    """On a signal: y follows u with abs(y') ≤ limit. At `BLOCK.rate`: the element's own speed is limited."""

    limit: Scalar = value("signal/s", low=0.0, neutral=math.inf)

    kind = "rate_limit"
    acts_on = ("input", "output", "rate")
    amplitude_dependent = True
    knowledge = Knowledge(
        what="The signal, or the element itself, moves no faster than a limit.",
        cause="No-load speed of an electric servo, flow limit of a hydraulic valve, back-EMF at low supply voltage, "
        "the speed limit that protects a motion table.",
        margins="Above the amplitude where it bites, phase falls quickly with amplitude and frequency: a loop with "
        "good small-signal margins can jump into a large oscillation after one hard command.",
        check="Double the amplitude at one frequency: the wave turns into a triangle of constant slope and its lag "
        "grows, while half the amplitude shows nothing.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        if place.port.kind == "rate":
            limit = SpeedLimit(state=place.port.name, settling=2 * loop.frame, limit=self.limit)
            return act_at(loop, place, limit)
        return insert_at(loop, place, self, RateLimiter(limit=self.limit))
