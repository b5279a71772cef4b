"""How a bench is wired: sampled controller first, then a chain of continuous blocks, as data."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from benchmarks.hidden_effects.blocks import ForcePort

Values = Mapping[str, float]


@dataclass(frozen=True)
class Output:
    """A signal that a block writes: y = C x + D u."""

    port: str
    signal: str
    C: Callable[[Values], tuple[float, ...]]
    D: Callable[[Values], float] = lambda values: 0.0


@dataclass(frozen=True)
class BlockPlan:
    """A linear block: its matrices from the loop's numbers, and the ports at which something may act in it."""

    name: str
    input_port: str
    input: str
    system: Callable[[Values], tuple[list, list]]
    outputs: tuple[Output, ...]
    force_ports: Mapping[str, ForcePort] = field(default_factory=dict)
    rate_port: str | None = None
    smoothing: float = 0.5


@dataclass(frozen=True)
class Controller:
    """The sampled part. With samplers it works on held values; without, on the continuous signals at every tick.

    samplers: (block, signal, sampled signal). integral, command: weights of signals, from the loop's numbers.
    """

    name: str
    command_signal: str
    period: int
    samplers: tuple[tuple[str, str, str], ...]
    integral: Callable[[Values], Mapping[str, float]] | None
    command: Callable[[Values], Mapping[str, float]]


@dataclass(frozen=True)
class Offer:
    """Effects that may be drawn at a port, the signals at which they show, and the signals that may be their source.

    judged: the signal at which the size is measured. scale_of: the signal whose size sets the range; is_rate: it is the
    rate that the effect sees, not the position. same_as: an effect that is the same as a change of a number of the
    loop, which no log can tell apart from a tolerance of that number.
    """

    port: str
    exits: tuple[str, ...]
    effects: tuple[str, ...]
    sources: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    judged: tuple[str, ...] = ()
    scale_of: str = ""
    is_rate: bool = False
    same_as: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Architecture:
    """One kind of bench; in its text every <name> stands for a number of the loop."""

    name: str
    title: str
    externals: tuple[str, ...]
    units: Mapping[str, str]
    controller: Controller
    chain: tuple[BlockPlan, ...]
    numbers: Mapping[str, tuple[float, float]]
    tolerances: Mapping[str, float]
    inside_noise: Mapping[str, float]
    outside_noise: Mapping[str, float]
    offers: tuple[Offer, ...]
    demand_size: tuple[float, float]
    text: str

    @property
    def measured(self) -> tuple[str, ...]:
        """Measured signals of the loop in signal order."""
        return (self.controller.command_signal, *(o.signal for b in self.chain for o in b.outputs))


def fill(text: str, values: Values) -> str:
    """The text with its numbers."""
    return re.sub(r"<([^>]+)>", lambda found: str(values[found[1]]), text)


def second_order(name: str) -> Callable[[Values], tuple[list, list]]:
    """Unit-gain second-order element; states position and rate."""

    def system(v: Values) -> tuple[list, list]:
        w, d = v[f"{name}.natural_frequency"], v[f"{name}.damping"]
        return [[0.0, 1.0], [-w * w, -2 * d * w]], [0.0, w * w]

    return system


def element(name: str, source: str, signal: str) -> BlockPlan:
    """A second-order sensor, table or actuator: position out, forces on its rate."""
    return BlockPlan(
        name,
        "input",
        source,
        second_order(name),
        (Output("output", signal, lambda v: (1.0, 0.0)),),
        {f"{name}.rate'": ForcePort(1, 0)},
        f"{name}.rate",
    )


def stack(formula: Callable[[Values], object], lanes: list[Values]) -> np.ndarray:
    """A number, list or matrix per lane."""
    return np.array([formula(values) for values in lanes], dtype=float)
