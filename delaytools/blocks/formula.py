"""A formula in a wire."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import final

from delaytools.blocks.block import CASADI, Continuous, Scalar, value
from delaytools.signals.expression import Expression

__all__ = ["FormulaBlock"]


@final
@dataclass(frozen=True, kw_only=True)
class FormulaBlock(Continuous):
    """y = formula(u, t, parameters, sources), u what enters and t in s.

    sources: other signals that the formula reads, each an input port of its own. neutral: parameter -> value; with
    all of these at it the block is a wire.
    """

    formula: Expression
    sources: tuple[str, ...] = ()
    parameters: Mapping[str, Scalar] = value(default=None, many=True)
    neutral: Mapping[str, float] = field(default_factory=dict)

    outputs = ("output",)
    states = ()
    initial_state = ()

    @property
    def inputs(self) -> tuple[str, ...]:
        return ("input", *self.sources)

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return ()

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        named = {**dict(zip(self.sources, u[1:], strict=True)), **(self.parameters or {}), "u": u[0], "t": t}
        return (self.formula.evaluate(named, CASADI),)
