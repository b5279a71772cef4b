"""Ports: the places in a loop where an effect can act."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous
from delaytools.blocks.equations import Equations
from delaytools.blocks.first_order import FirstOrder
from delaytools.blocks.integrator import Integrator
from delaytools.blocks.second_order import SecondOrder
from delaytools.blocks.transfer_function import TransferFunction
from delaytools.loop.loop import Element, Loop
from delaytools.signals.expression import Expression
from delaytools.signals.trouble import DesignError

__all__ = ["Port", "derivative_states", "find_port", "first_unit", "ports", "read_at", "written_at", "written_behind"]


@final
@dataclass(frozen=True)
class Port:
    """kind: "input", "output", "derivative" (of state `name`), "rate" (of a second-order element) or "block"."""

    element: str
    kind: str
    name: str

    def __str__(self) -> str:
        mark = "'" if self.kind == "derivative" else ""
        return f"{self.element}.{self.name}{mark}" if self.name else self.element


def derivative_states(element: Element) -> tuple[str, ...]:
    """States of the element at whose derivative forces and moments act."""
    match element.block:
        case Integrator() | FirstOrder():
            return ("output",)
        case SecondOrder():
            return ("rate",)
        case TransferFunction(order=1, numerator=b, denominator=a) if len(b) < len(a):
            return ("output",)
        case Equations(states=states):
            return states
    return ()


def ports(element: Element) -> tuple[Port, ...]:
    """Every port of the element."""
    found = [Port(element.name, "input", name) for name in element.inputs]
    found += [Port(element.name, "output", name) for name in element.outputs]
    if isinstance(element.block, SecondOrder):
        found.append(Port(element.name, "rate", "rate"))
    if isinstance(element.block, Continuous):
        found += [Port(element.name, "derivative", name) for name in derivative_states(element)]
    return tuple(found)


def read_at(loop: Loop, port: Port) -> Expression:
    """What enters an input port as the design wires it, ahead of the effects that act there."""
    found = loop[port.element].inputs[port.name]
    while found.text.endswith(".output") and "@" in found.text:
        found = next(iter(loop[loop.writers[found.text][0]].inputs.values()))
    return found


def written_behind(loop: Loop, signal: str) -> str:
    """The named signal that leaves a chain of effects at an output, given what enters the chain."""
    while signal.endswith(".input") and "@" in signal:
        follower = next(e for e in loop.elements if any(x.text == signal for x in e.inputs.values()))
        signal = follower.outputs["output"]
    return signal


def first_unit(loop: Loop, element: Element) -> str:
    """The unit of the first signal that an element writes, behind the effects there; "" where none is named."""
    return loop.units.get(written_behind(loop, next(iter(element.outputs.values()))), "")


def written_at(loop: Loop, port: Port) -> str:
    """The signal that an output port writes, behind the effects that act there."""
    return written_behind(loop, loop[port.element].outputs[port.name])


def find_port(loop: Loop, text: str) -> Port:
    """The port written as `BLOCK.input`, `BLOCK.output`, `BLOCK.NAME`, `BLOCK.rate` or `BLOCK.STATE'`.

    Raises DesignError that lists the ports there are.
    """
    block, _, name = text.partition(".")
    elements = {element.name: element for element in loop.elements if "@" not in element.name}
    if block not in elements:
        raise DesignError(
            "unknown port", found=repr(text), known=sorted(elements), advice="write BLOCK.input"
        )
    if not name:
        return Port(block, "block", "")
    known = ports(elements[block])
    for port in known:
        if str(port) == text:
            return port
    raise DesignError("unknown port", found=repr(text), known=[str(port) for port in known])
