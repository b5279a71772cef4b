"""One of a block's own values is another than the design says."""

from dataclasses import dataclass, replace
from typing import final

from delaytools.blocks.block import Scalar, flat_values, with_values
from delaytools.effects.effect import Effect, Knowledge, Place
from delaytools.loop.loop import Loop
from delaytools.signals.expression import signal_expression
from delaytools.signals.trouble import DesignError

__all__ = ["ParameterChange"]


@final
@dataclass(frozen=True, kw_only=True)
class ParameterChange(Effect):
    """The block's value `name` (`damping`, `denominator[1]`) is `new`; None leaves it as it is.

    The new value stands at `effects.N.name`; the block's own reads it. Raises DesignError, listing the
    block's values, for a name that the block has not.
    """

    name: str
    new: Scalar | None = None

    kind = "parameter_change"
    acts_on = ("block",)
    amplitude_dependent = False
    knowledge = Knowledge(
        what="An element is of the kind that the design says, but one of its numbers is another.",
        cause="Data sheet instead of measurement, hardware that differs from piece to piece (the four actuators of "
        "Rao 2023), temperature, supply, wear, another loading of the table.",
        margins="Depends on the number: a lower natural frequency or bandwidth takes phase at crossover, less damping "
        "raises a peak that uses up gain margin.",
        check="Measure the element alone, input and output, with a sweep inside its linear range, and fit only its own "
        "numbers; repeat on a second piece.",
    )

    def apply(self, loop: Loop, place: Place) -> Loop:
        element = loop[place.port.element]
        known = flat_values(element.block)
        if self.name not in known:
            raise DesignError(
                "the block has no such value",
                where=str(place.port),
                found=repr(self.name),
                known=tuple(known),
            )
        if self.new is None:
            return loop
        path = f"{place.path}.{self.name}"
        changed = with_values(element.block, {self.name: signal_expression(path)})
        named = replace(loop, parameters={**loop.parameters, path: self.new})
        return named.replaced(replace(element, block=changed))
