"""An effect that a hypothesis adds to a segment: its kind, its port, the values that a fit moves."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, final

from delaytools.blocks.block import Specification, specifications
from delaytools.design.catalogue import EFFECTS, PARAMETER_CHANGE
from delaytools.effects.effect import Effect, Place
from delaytools.effects.parameter_change import ParameterChange
from delaytools.loop.loop import Loop
from delaytools.loop.port import find_port
from delaytools.signals.parameter import Parameter

__all__ = ["SEEN", "Added", "by_itself", "is_added", "path_of", "places_in_file", "with_added"]

NUISANCE = ("smoothing",)
TIMES = {"transient_gain": ("start", "end")}  # of jumps
SEEN = "@seen"  # behind a signal's name: the signal as measured, without its noise
DULL = 0.99  # of the most damping that a mode may have
FIRST_NUMBER = 1000  # effects of a hypothesis are numbered from here, behind those of any design


@final
@dataclass(frozen=True)
class Added:
    """An effect with starting values for what is free; `fixed` holds the rest (a source signal).

    kind: as a design file names it (`parameter_change:damping` included). at: port. values: name -> start.
    held: names among `values` that a fit leaves as they are. limits: bounds narrower than the catalogue's.
    errors: standard errors of held values that were found another way than by a fit. rank: its place among the effects
    at its port, the least first along the signal; of equals the one that was found earlier. along: state of its block,
    and the measured signal along which the effect acts in its stead: a force may drive the model away by itself.
    """

    kind: str
    at: str
    values: Mapping[str, float]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    held: frozenset[str] = frozenset()
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    errors: Mapping[str, float] = field(default_factory=dict)
    rank: int = 0
    along: Mapping[str, str] = field(default_factory=dict)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the values that a fit moves."""
        return tuple(name for name in self.values if name not in self.held)

    @property
    def reported(self) -> tuple[str, ...]:
        """Names of the values that an answer states; smoothing widths are no property of the bench."""
        return tuple(name for name in self.values if name not in NUISANCE)

    @property
    def key(self) -> tuple[str, str, tuple[Any, ...]]:
        """What tells two candidates apart: kind, port and sources, whatever the values."""
        return self.kind, self.at, tuple(sorted(self.fixed.items()))

    @property
    def shape(self) -> tuple[Any, ...]:
        """What tells two loops apart that hold it, whatever the values of a fit."""
        held = tuple(self.values[name] for name in self.held)
        return self.key, self.rank, tuple(self.values), self.held, held, tuple(sorted(self.along.items()))

    @property
    def step_shape(self) -> tuple[Any, ...]:
        """As `shape`, but of all windows of gain in one place: their edges move the grid of a run, not its step."""
        times = TIMES.get(self.kind, ())
        held = tuple(self.values[name] for name in self.held if name not in times)
        return self.key, self.rank, tuple(self.values), self.held, held, tuple(sorted(self.along.items()))

    def held_times(self, number: int) -> dict[str, float]:
        """Path -> value of the times of jumps that a fit leaves as they are."""
        times = TIMES.get(self.kind, ())
        return {path_of(number, name): self.values[name] for name in times if name in self.held}

    @property
    def name(self) -> str:
        """TYPE@PORT."""
        return f"{self.kind}@{self.at}"

    @property
    def is_dull(self) -> bool:
        """Whether it is a lightly damped mode, damped up to where one is sought: any slow answer is like that."""
        most = self.limits.get("damping", (0.0, math.inf))[1]
        return self.kind == "flexible_mode" and self.values["damping"] > DULL * most

    @property
    def as_smooth(self) -> "Added":
        """The same effect, as smooth in any fit: a friction that is left alone becomes as stiff as it may be."""
        return replace(self, held=self.held | (set(NUISANCE) & set(self.values)))

    def moved(self, values: Mapping[str, float]) -> "Added":
        """The same effect with other values."""
        return replace(self, values={**self.values, **values})

    def effect(self) -> Effect:
        """The effect of the catalogue with these values."""
        if self.kind.startswith(PARAMETER_CHANGE):
            name = self.kind.partition(":")[2]
            return ParameterChange(name=name, new=self.values[name])
        return EFFECTS[self.kind](**self.values, **self.fixed)

    def specification(self, loop: Loop, name: str) -> Specification:
        """The bounds of a value."""
        if self.kind.startswith(PARAMETER_CHANGE):
            block = loop[find_port(loop, self.at).element].block
            return specifications(block).get(name.partition("[")[0], Specification())
        return specifications(EFFECTS[self.kind])[name]

    def parameters(self, loop: Loop, number: int) -> tuple[Parameter, ...]:
        """The values as parameters of a fit, by their paths in the loop of `with_added`."""
        found = []
        for name in self.free:
            spec = self.specification(loop, name)
            value = self.values[name]
            margin = 1e-6 * max(abs(value), 1e-9)
            low = spec.low + margin if spec.low == (spec.neutral or 0.0) or spec.exclusive else spec.low
            ends = self.limits.get(name, (low, spec.high))
            low, high = max(low, ends[0]), min(spec.high, ends[1])
            found.append(
                Parameter(path_of(number, name), value, low=min(low, value), high=max(high, value))
            )
        return tuple(found)


def path_of(place: int, name: str = "") -> str:
    """The path of an effect of a hypothesis by its place, or of its value of that name."""
    return f"effects.{FIRST_NUMBER + place}" + (f".{name}" if name else "")


def is_added(path: str) -> bool:
    """Whether a path is that of a hypothesis's effect, not of the design's."""
    first, _, rest = path.partition(".")
    return first == "effects" and int(rest.partition(".")[0]) >= FIRST_NUMBER


def with_added(loop: Loop, added: tuple[Added, ...]) -> Loop:
    """The loop with these effects, numbered in order, each at its port behind those of lower rank."""
    for number, one in sorted(enumerate(added), key=lambda item: item[1].rank):
        loop = one.effect().apply(loop, Place(find_port(loop, one.at), one.name, path_of(number)))
        if one.along:
            host = loop[find_port(loop, one.at).element]
            acting = replace(host.modifiers[-1], seen={s: f"{exit}{SEEN}" for s, exit in one.along.items()})
            loop = loop.replaced(replace(host, modifiers=(*host.modifiers[:-1], acting)))
    return loop


def by_itself(added: tuple[Added, ...]) -> tuple[Added, ...]:
    """The effects as they act in a run of the model alone, along no measured motion."""
    return tuple(replace(one, along={}) for one in added)


def places_in_file(added: tuple[Added, ...]) -> tuple[int, ...]:
    """Places of effects in the order of a design file: those at one port share their places among them by rank."""
    places = list(range(len(added)))
    for at in {one.at for one in added}:
        own = [k for k, one in enumerate(added) if one.at == at]
        for k, place in zip(own, sorted(own, key=lambda k: added[k].rank), strict=True):
            places[k] = place
    return tuple(places)
