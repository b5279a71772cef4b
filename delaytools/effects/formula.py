"""An effect that its user writes as a formula."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np

from delaytools.blocks.block import CASADI, Scalar, value
from delaytools.blocks.formula import FormulaBlock
from delaytools.effects.effect import Effect, Knowledge, Place, act_at, insert_at
from delaytools.loop.loop import Loop
from delaytools.loop.modifier import FORCE, Modifier, StateView
from delaytools.loop.port import Port, derivative_states
from delaytools.signals.expression import Expression, check_name, signal_expression
from delaytools.signals.trouble import DesignError

__all__ = ["FormulaEffect"]

OWN = ("u", "x", "v", "t")
TRIED = (-1.3, -0.4, 0.0, 0.7, 2.1)  # values of every name at which a neutral formula is checked


@final
@dataclass(frozen=True, kw_only=True)
class FormulaForce(Modifier):
    """v' = … + formula(x, v, t, states, parameters, signals)."""

    state: str
    formula: Expression
    named: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, Scalar] = value(default=None, many=True)
    neutral: Mapping[str, float] = field(default_factory=dict)

    stage = FORCE
    amplitude_dependent = False

    @property
    def sources(self) -> tuple[str, ...]:
        return tuple(self.named.values())

    def modify(self, view: StateView) -> Mapping[str, Scalar]:
        known = {**view.states, **dict(zip(self.named, view.sources, strict=True)), **(self.parameters or {})}
        known |= {"v": view.states[self.state], "t": view.t}
        if view.position:
            known["x"] = view.states[view.position]
        return {self.state: view.rates[self.state] + self.formula.evaluate(known, CASADI)}


@final
@dataclass(frozen=True, kw_only=True)
class FormulaEffect(Effect):
    """y = formula on a signal, v' = … + formula on a derivative, in the user's own words.

    The formula reads its parameters, t (s), and any signal by name; on a signal also u, what arrives there; on a
    derivative also the block's states, v (the state acted on), x (the position whose rate v is) and u (what enters
    the block, where that is one signal). neutral: parameter -> value; with all of these at it nothing changes.
    Raises DesignError for a name with two meanings, for no position, and where the formula at its neutral values
    is not u (on a derivative: not 0).
    """

    formula: Expression
    parameters: Mapping[str, Scalar] = value(default=None, many=True)
    neutral: Mapping[str, float] = field(default_factory=dict)

    kind = "formula"
    acts_on = ("input", "output", "derivative")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="What the user's own formula says happens to the signal, or is added to the derivative.",
        cause="Whatever the user of this bench knows of it and the catalogue does not: a calibration curve, a valve's "
        "characteristic, a force measured beside the bench.",
        margins="Linear analysis takes the formula's slope at the operating point; what bends there shows in time "
        "runs only.",
        check="Measure input and output of the element alone over the range that the formula claims, and plot one "
        "over the other with the formula drawn in.",
    )

    def __post_init__(self) -> None:
        for name in self.parameters or {}:
            check_name(name, "parameter")
            if name in OWN:
                advice = f"{', '.join(OWN)} have a meaning of their own here: choose another name"
                raise DesignError(
                    "one name with two meanings", where="parameters", found=repr(name), advice=advice
                )
        for name in self.neutral:
            if name not in (self.parameters or {}):
                known = tuple(self.parameters or {})
                raise DesignError(
                    "a neutral value of no parameter", where="neutral", found=repr(name), known=known
                )

    def signals(self, loop: Loop, port: Port) -> tuple[str, ...]:
        """Names in the formula that are signals of the loop, or should be."""
        known = {*(self.parameters or {}), "t"}
        if port.kind == "derivative":
            known |= {*OWN, *derivative_states(loop[port.element])}
        else:
            known |= {"u"}
        return tuple(name for name in self.formula.names if name not in known)

    def apply(self, loop: Loop, place: Place) -> Loop:
        self._check_neutral(force=place.port.kind == "derivative")
        names = self.signals(loop, place.port)
        if place.port.kind == "derivative":
            return act_at(loop, place, self._force(loop, place.port, names))
        block = FormulaBlock(
            formula=self.formula, sources=names, parameters=self.parameters, neutral=self.neutral
        )
        return insert_at(loop, place, self, block, sources={name: signal_expression(name) for name in names})

    def _force(self, loop: Loop, port: Port, names: tuple[str, ...]) -> FormulaForce:
        named = {name: name for name in names}
        if "u" in self.formula.names:
            named["u"] = _entering(loop, port)
        return FormulaForce(
            state=port.name,
            formula=self.formula,
            named=named,
            parameters=self.parameters,
            neutral=self.neutral,
        )

    def _check_neutral(self, *, force: bool) -> None:
        if not self.neutral:
            return
        names = [name for name in self.formula.names if name not in self.neutral]
        for k, number in enumerate(TRIED):
            tried = {name: TRIED[(k + j) % len(TRIED)] for j, name in enumerate(names)} | {"u": number}
            with np.errstate(all="ignore"):
                arrays = {name: np.float64(one) for name, one in {**tried, **self.neutral}.items()}
                found = float(self.formula.evaluate(arrays))
            wanted = 0.0 if force else number
            if np.isfinite(found) and abs(found - wanted) > 1e-9:
                raise DesignError(
                    "a formula that changes something at its neutral values",
                    where="neutral",
                    found=f"{found:g} for u = {number:g}",
                    advice=f"at its neutral values the formula is {'0' if force else 'u'}; or leave neutral out",
                )


def _entering(loop: Loop, port: Port) -> str:
    """The one signal that enters a block."""
    inputs = list(loop[port.element].inputs.values())
    if len(inputs) != 1 or inputs[0].names != (inputs[0].text.strip(),):
        raise DesignError(
            "u is what enters the block, and that is not one signal here",
            where=str(port),
            found=", ".join(x.text for x in inputs),
            advice="write the signals by their names",
        )
    return inputs[0].names[0]
