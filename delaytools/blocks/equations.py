"""Any nonlinear block, written as formulas in the design file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import final

from delaytools.blocks.block import CASADI, Continuous, Scalar, value
from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError

__all__ = ["Equations"]


@final
@dataclass(frozen=True, kw_only=True)
class Equations(Continuous):
    """state' = rates(states, inputs, parameters), output = outputs(states, inputs, parameters).

    input_names: the input ports. start: state -> value at t = 0. parameters: name -> value.
    rates: state -> formula. formulas: output -> formula. Raises DesignError for a name that nothing defines,
    for a state without a rate, and for one name with two meanings.
    """

    input_names: tuple[str, ...]
    start: Mapping[str, Scalar] = value(default=None, many=True)
    parameters: Mapping[str, Scalar] = value(default=None, many=True)
    rates: Mapping[str, Expression] = field(default_factory=dict)
    formulas: Mapping[str, Expression] = field(default_factory=dict)
    shared: Mapping[str, Scalar] = field(default_factory=dict)

    def __post_init__(self) -> None:
        states, rates = set(self.start or {}), set(self.rates)
        if states != rates:
            odd = sorted(states ^ rates)
            raise DesignError("every state needs one rate and every rate a state", found=", ".join(odd))
        if not self.formulas:
            raise DesignError(
                "an equations block needs outputs", advice='write outputs = { name = "formula" }'
            )
        groups = [self.input_names, tuple(self.start or {}), tuple(self.parameters or {}), tuple(self.shared)]
        names = [name for group in groups for name in group]
        clash = sorted({name for name in names if names.count(name) > 1})
        if clash:
            raise DesignError(
                "one name with two meanings",
                found=", ".join(clash),
                advice="rename the input, state or parameter",
            )
        for place, formula in (*self.rates.items(), *self.formulas.items()):
            for name in formula.names:
                if name not in names:
                    raise DesignError(
                        f"unknown name in the formula of {place}", found=repr(name), known=sorted(names)
                    )

    @property
    def inputs(self) -> tuple[str, ...]:
        return self.input_names

    @property
    def outputs(self) -> tuple[str, ...]:
        return tuple(self.formulas)

    @property
    def states(self) -> tuple[str, ...]:
        return tuple(self.start or {})

    @property
    def initial_state(self) -> tuple[Scalar, ...]:
        return tuple((self.start or {}).values())

    def _names(self, x: Sequence[Scalar], u: Sequence[Scalar]) -> dict[str, Scalar]:
        named = dict(zip(self.states, x, strict=True)) | dict(zip(self.inputs, u, strict=True))
        return named | dict(self.parameters or {}) | dict(self.shared)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        names = self._names(x, u)
        return tuple(self.rates[state].evaluate(names, CASADI) for state in self.states)

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        names = self._names(x, u)
        return tuple(formula.evaluate(names, CASADI) for formula in self.formulas.values())
