"""Which kinds of case there are, how many of each, and what each plants."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.hidden_effects.architecture import Architecture, Offer
from benchmarks.hidden_effects.catalogue import NAMED, UNKNOWN_FORCE, UNKNOWN_WIRE

Generator = np.random.Generator
MIX = {
    "none": 40,
    "single": 140,
    "double": 50,
    "triple": 15,
    "unknown": 30,
    "weak_drift": 8,
    "same_segment": 8,
    "short_transient": 8,
    "light_mode": 7,
    "rest_quantisation": 7,
    "friction_pair": 7,
}
FRICTION_PAIRS = (
    ("coulomb_friction", "load_dependent_friction"),
    ("cubic_damping", "quadratic_drag"),
    ("coulomb_friction", "cubic_damping"),
    ("coulomb_friction", "backlash"),
    ("stribeck_friction", "quadratic_drag"),
    ("dead_band", "coulomb_friction"),
)
TIMED_TOGETHER = ("delay", "variable_delay", "lag")
ONE_FRICTION = ("coulomb_friction", "stribeck_friction")  # of one speed: the first only raises two values of the second


@dataclass(frozen=True)
class Wish:
    """An effect to be planted, with the range of its size in noises and some of its numbers."""

    effect: str
    offer: Offer
    sizes: tuple[float, float] = (0.5, 100.0)
    options: dict[str, float] = field(default_factory=dict)


def kind_of(number: int, seed: int) -> tuple[str, int]:
    """Kind of case `number` (from 1), and which of its kind it is."""
    order = [kind for kind, count in MIX.items() for _ in range(count)]
    np.random.default_rng([seed, 0]).shuffle(order)
    place = (number - 1) % len(order)
    cycle = (number - 1) // len(order)
    return order[place], order[:place].count(order[place]) + cycle * MIX[order[place]]


def wishes(kind: str, turn: int, architecture: Architecture, rng: Generator) -> list[Wish]:
    """What a case of this kind plants on this bench; raises LookupError where the bench does not offer it."""
    if kind == "none":
        return []
    if kind in ("single", "double", "triple"):
        first = NAMED[turn % len(NAMED)] if kind == "single" else str(rng.choice(NAMED))
        return _several(first, {"single": 1, "double": 2, "triple": 3}[kind], architecture, rng)
    return _SPECIAL[kind](turn, architecture, rng)


def _offers(effect: str, architecture: Architecture) -> list[Offer]:
    found = [offer for offer in architecture.offers if effect in offer.effects]
    if not found:
        raise LookupError(effect)
    return found


def _pick(effect: str, architecture: Architecture, rng: Generator) -> Wish:
    offers = _offers(effect, architecture)
    return Wish(effect, offers[int(rng.integers(len(offers)))])


def _several(first: str, count: int, architecture: Architecture, rng: Generator) -> list[Wish]:
    plan = [_pick(first, architecture, rng)]
    while len(plan) < count:
        effect = str(rng.choice(NAMED))
        try:
            new = _pick(effect, architecture, rng)
        except LookupError:
            continue
        if not any(_clash(new, old) for old in plan):
            plan.append(new)
    return plan


def _clash(one: Wish, other: Wish) -> bool:
    """Two effects no log could tell apart: one kind twice in a segment, two timings in a row, a friction as two."""
    if one.offer.exits[0] != other.offer.exits[0]:
        return False
    both_timed = one.effect in TIMED_TOGETHER and other.effect in TIMED_TOGETHER
    one_friction = one.effect in ONE_FRICTION and other.effect in ONE_FRICTION
    return both_timed or one_friction or one.effect == other.effect


def _weak_drift(turn: int, a: Architecture, rng: Generator) -> list[Wish]:
    wish = _pick("gain_drift", a, rng)
    return [Wish("gain_drift", wish.offer, (0.5, 6.0))]


def _same_segment(turn: int, a: Architecture, rng: Generator) -> list[Wish]:
    for _ in range(200):
        pair = _several(str(rng.choice(NAMED)), 1, a, rng) + _several(str(rng.choice(NAMED)), 1, a, rng)
        if pair[0].offer.exits[0] == pair[1].offer.exits[0] and not _clash(*pair):
            return pair
    raise LookupError("same_segment")


def _short_transient(turn: int, a: Architecture, rng: Generator) -> list[Wish]:
    wish = _pick("transient_gain", a, rng)
    plan = [Wish("transient_gain", wish.offer, (0.5, 100.0), {"duration": 0.5})]
    beside = [o for o in _offers("scale_factor", a) if o.exits[0] == wish.offer.exits[0]]
    if turn % 2 and beside:
        plan.append(Wish("scale_factor", beside[0], (1.0, 30.0)))
    return plan


def _light_mode(turn: int, a: Architecture, rng: Generator) -> list[Wish]:
    wish = _pick("flexible_mode", a, rng)
    return [
        Wish("flexible_mode", wish.offer, (0.5, 60.0), {"damping": round(float(rng.uniform(0.003, 0.02)), 4)})
    ]


def _rest_quantisation(turn: int, a: Architecture, rng: Generator) -> list[Wish]:
    wish = _pick("quantization", a, rng)
    return [Wish("quantization", wish.offer, (2.0, 30.0))]


def _friction_pair(turn: int, a: Architecture, rng: Generator) -> list[Wish]:
    pair = FRICTION_PAIRS[turn % len(FRICTION_PAIRS)]
    for _ in range(100):
        plan = [_pick(effect, a, rng) for effect in pair]
        if plan[0].offer.exits == plan[1].offer.exits:
            return plan
    raise LookupError("friction_pair")


def _unknown(turn: int, a: Architecture, rng: Generator) -> list[Wish]:
    names: Sequence[str] = UNKNOWN_WIRE + UNKNOWN_FORCE
    effect = names[turn % len(names)]
    like = "coulomb_friction" if effect in UNKNOWN_FORCE else "dead_band"
    wish = _pick(like, a, rng)
    return [Wish(effect, wish.offer, (3.0, 100.0))]


_SPECIAL = {
    "weak_drift": _weak_drift,
    "same_segment": _same_segment,
    "short_transient": _short_transient,
    "light_mode": _light_mode,
    "rest_quantisation": _rest_quantisation,
    "friction_pair": _friction_pair,
    "unknown": _unknown,
}
