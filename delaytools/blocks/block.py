"""What a block is: values with units, and one of four natures that say how it acts.

Each block states its formulas once, on CasADi symbols or numbers alike; simulation, linearisation, tuning and
fitting all read these lines.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np

__all__ = [
    "CASADI",
    "Block",
    "Continuous",
    "Follower",
    "Sampled",
    "Scalar",
    "Specification",
    "Transport",
    "flat_values",
    "required",
    "specifications",
    "value",
    "with_values",
]

if hasattr(ca.GlobalOptions, "setNumpyMode"):
    ca.GlobalOptions.setNumpyMode(1)  # NumPy functions on symbols give symbols

Scalar = Any  # a float, a CasADi symbol, or an Expression of [parameters] that is not resolved yet

CASADI = {
    "abs": ca.fabs,
    "sign": ca.sign,
    "sin": ca.sin,
    "cos": ca.cos,
    "tan": ca.tan,
    "tanh": ca.tanh,
    "exp": ca.exp,
    "log": ca.log,
    "sqrt": ca.sqrt,
    "min": ca.fmin,
    "max": ca.fmax,
}


@final
@dataclass(frozen=True)
class Specification:
    """What a value of a block or effect may be.

    unit: a unit such as "rad/s"; "signal" for the unit of the signal acted on, "signal/s" for its rate,
    "derivative" for the unit of a state's derivative; "name" for a signal's name. low, high: bounds (open where
    `exclusive`). neutral: the value that changes nothing (None where there is none).
    """

    unit: str = ""
    low: float = -np.inf
    high: float = np.inf
    exclusive: bool = False
    neutral: float | None = None
    many: bool = False

    def allows(self, number: float) -> bool:
        """Whether the number lies within the bounds."""
        if np.isnan(number):
            return False
        return self.low < number < self.high if self.exclusive else self.low <= number <= self.high


def value(
    unit: str = "",
    *,
    default: Any = MISSING,
    low: float = -np.inf,
    high: float = np.inf,
    exclusive: bool = False,
    neutral: float | None = None,
    many: bool = False,
) -> Any:
    """A field of a block that a design file may give, with its Specification."""
    spec = Specification(unit, low, high, exclusive, neutral, many)
    return field(default=default, metadata={"specification": spec})


def specifications(kind: type | object) -> dict[str, Specification]:
    """The values that a kind of block or effect takes, by name."""
    return {f.name: f.metadata["specification"] for f in fields(kind) if "specification" in f.metadata}  # type: ignore[arg-type]


def required(kind: type) -> tuple[str, ...]:
    """The names of the values that have no default."""
    return tuple(
        f.name
        for f in fields(kind)
        if "specification" in f.metadata and f.default is MISSING  # type: ignore[arg-type]
    )


def flat_values(block: object) -> dict[str, Scalar]:
    """Every scalar value by name; an element of a list is `name[0]`, of a matrix `name[0][1]`."""
    found: dict[str, Scalar] = {}
    for name, spec in specifications(block).items():
        if spec.unit != "name":
            _flatten(name, getattr(block, name), found)
    return found


def _flatten(name: str, item: Any, found: dict[str, Scalar]) -> None:
    if isinstance(item, tuple):
        for index, element in enumerate(item):
            _flatten(f"{name}[{index}]", element, found)
    elif isinstance(item, Mapping):
        for key, element in item.items():
            _flatten(key, element, found)
    elif item is not None and not isinstance(item, str):
        found[name] = item


def with_values(block: Any, new: Mapping[str, Scalar]) -> Any:
    """The same block with some scalar values replaced, named as `flat_values` names them."""
    changes = {
        name: _rebuild(name, getattr(block, name), new)
        for name, spec in specifications(block).items()
        if spec.unit != "name"
    }
    return replace(block, **changes)


def _rebuild(name: str, item: Any, new: Mapping[str, Scalar]) -> Any:
    if isinstance(item, tuple):
        return tuple(_rebuild(f"{name}[{index}]", element, new) for index, element in enumerate(item))
    if isinstance(item, Mapping):
        return {key: _rebuild(key, element, new) for key, element in item.items()}
    return new.get(name, item)


class Block(ABC):
    """Something physical with named input and output ports.

    amplitude_dependent: whether linear analysis takes it as a wire (a dead band, a limit, play, a quantiser).
    """

    amplitude_dependent: ClassVar[bool] = False

    @property
    @abstractmethod
    def inputs(self) -> tuple[str, ...]:
        """Names of the input ports."""

    @property
    @abstractmethod
    def outputs(self) -> tuple[str, ...]:
        """Names of the output ports."""


class Continuous(Block):
    """x' = rate(t, x, u), y = output(t, x, u)."""

    @property
    @abstractmethod
    def states(self) -> tuple[str, ...]:
        """Names of the states."""

    @property
    @abstractmethod
    def initial_state(self) -> tuple[Scalar, ...]:
        """States at t = 0."""

    @abstractmethod
    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Derivatives of the states, per second."""

    @abstractmethod
    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Values of the output ports."""


class Sampled(Block):
    """At t = 0, period, 2 period, …: (x⁺, y) = update(x, u); y holds until the next update."""

    period: Scalar

    @property
    @abstractmethod
    def states(self) -> tuple[str, ...]:
        """Names of the states kept from tick to tick."""

    @property
    @abstractmethod
    def initial_state(self) -> tuple[Scalar, ...]:
        """States before the first tick."""

    @abstractmethod
    def update(
        self, x: Sequence[Scalar], u: Sequence[Scalar], held: Sequence[Scalar]
    ) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        """New states and new outputs; `held` are the outputs of the tick before."""


class Transport(Block):
    """y(t) = u(t - delay(t)), exactly."""

    @abstractmethod
    def seconds(self, t: Scalar, u: Sequence[Scalar]) -> Scalar:
        """The delay in s at time t; `u` are the inputs beyond the first (a column that holds the delay)."""

    @property
    @abstractmethod
    def varies(self) -> bool:
        """Whether the delay depends on time."""


class Follower(Block):
    """A rate-independent or slew-limited memory: y(t) = follow(y(t₀), u(t), t - t₀), with one state, y itself.

    Neither an ODE nor sampled: the play operator and the slew limit are exact in this form wherever the input
    moves in one direction between t₀ and t.
    """

    @abstractmethod
    def follow(self, memory: Scalar, u: Scalar, elapsed: Scalar) -> Scalar:
        """The output `elapsed` seconds after it was `memory`."""

    @property
    @abstractmethod
    def start(self) -> float | None:
        """The memory at t = 0; None: the input's own value then."""
