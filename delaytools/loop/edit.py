"""Loop → Loop: put a block at a port, act on a derivative, take a block out, open the loop at a signal."""

from collections.abc import Mapping
from dataclasses import replace

from delaytools.blocks.block import Block, Transport
from delaytools.blocks.gain import Gain
from delaytools.loop.loop import Element, Loop, Placed
from delaytools.loop.port import Port, written_at
from delaytools.signals.expression import Expression, signal_expression
from delaytools.signals.trouble import DesignError

__all__ = ["act", "cut", "disturbed_at", "held_at", "insert", "reader", "remove", "wire"]


def insert(
    loop: Loop,
    port: Port,
    block: Block,
    *,
    element: Element | None = None,
    sources: dict[str, Expression] | None = None,
) -> Loop:
    """The loop with `block` between the port and what it is wired to, nearest to the port's downstream side.

    The block's first input carries the port's signal; `sources` wires its other inputs. `element` gives the
    name, path and marks of the new element (its block and wiring are filled in here).
    """
    mark = element or Element(f"{type(block).__name__}@{port}", block, {}, {})
    mark = replace(mark, name=_free_name(loop, mark.name))
    host = loop[port.element]
    first, *others = block.inputs
    wiring = {name: (sources or {})[name] for name in others}
    if port.kind == "input":
        joint = f"{mark.name}.output"
        new = replace(
            mark, block=block, inputs={first: host.inputs[port.name], **wiring}, outputs={"output": joint}
        )
        host = replace(host, inputs={**host.inputs, port.name: signal_expression(joint)})
        return _placed(loop, host, new, before=True)
    if port.kind == "output":
        joint = f"{mark.name}.input"
        signal = written_at(loop, port)
        last = loop[loop.writers[signal][0]]
        new = replace(
            mark, block=block, inputs={first: signal_expression(joint), **wiring}, outputs={"output": signal}
        )
        renamed = {name: joint if s == signal else s for name, s in last.outputs.items()}
        return _placed(loop, replace(last, outputs=renamed), new, before=False)
    raise DesignError(
        "this acts on a signal", where=str(port), found=f"a {port.kind} port", advice="use an input or output"
    )


def _free_name(loop: Loop, name: str) -> str:
    taken = {element.name for element in loop.elements}
    number, free = 2, name
    while free in taken:
        free, number = f"{name}#{number}", number + 1
    return free


def _placed(loop: Loop, host: Element, new: Element, *, before: bool) -> Loop:
    pair = (new, host) if before else (host, new)
    elements: list[Element] = []
    for element in loop.elements:
        elements.extend(pair if element.name == host.name else (element,))
    return replace(loop, elements=tuple(elements))


def act(loop: Loop, port: Port, placed: Placed) -> Loop:
    """The loop with a modifier on the derivative of a state of the port's block."""
    host = loop[port.element]
    return loop.replaced(replace(host, modifiers=(*host.modifiers, placed)))


def wire(element: Element) -> Element:
    """The element replaced by a wire from its first input; raises DesignError where that has no clear meaning."""
    names = element.block.inputs
    single = len(names) == 1 or isinstance(element.block, Transport) or names[0] == "input"
    if len(element.outputs) != 1 or not single:
        raise DesignError(
            "only a block with one input and one output can be replaced by a wire",
            where=element.name,
            found=f"{len(element.inputs)} inputs, {len(element.outputs)} outputs",
        )
    source = element.inputs[names[0]]
    target = next(iter(element.outputs.values()))
    return replace(element, block=Gain(), inputs={"input": source}, outputs={"output": target}, modifiers=())


def remove(loop: Loop, name: str) -> Loop:
    """The loop with a block replaced by a wire, or without the effect `TYPE@PORT`."""
    if any(element.name == name for element in loop.elements):
        return loop.replaced(wire(loop[name]))
    for element in loop.elements:
        kept = tuple(p for p in element.modifiers if p.name != name)
        if len(kept) < len(element.modifiers):
            return loop.replaced(replace(element, modifiers=kept))
    known = [e.name for e in loop.elements] + [p.name for e in loop.elements for p in e.modifiers]
    raise DesignError("nothing of that name to remove", found=repr(name), known=known)


def reader(signal: str) -> str:
    """The name under which a cut loop reads the signal that it no longer writes."""
    return f"{signal}@read"


def cut(loop: Loop, signal: str, *, reads: str | None = None) -> Loop:
    """The loop opened at the signal's writer: what read `signal` now reads `reads` (default: `reader(signal)`)."""
    if signal not in loop.writers:
        known = [name for name in loop.signals if name in loop.writers]
        raise DesignError(
            "the loop can be opened where a block writes a signal", found=repr(signal), known=known
        )
    name = reads or reader(signal)
    elements = tuple(_reads_instead(element, signal, name) for element in loop.elements)
    units = dict(loop.units) | ({name: loop.units[signal]} if signal in loop.units else {})
    return replace(loop, elements=elements, units=units)


def _reads_instead(element: Element, signal: str, name: str) -> Element:
    inputs = {port: x.renamed({signal: name}) for port, x in element.inputs.items()}
    modifiers = tuple(replace(p, instead={**p.instead, signal: name}) for p in element.modifiers)
    return replace(element, inputs=inputs, modifiers=modifiers)


def held_at(loop: Loop, values: Mapping[str, float]) -> Loop:
    """The loop with external inputs held at these values (in their units): what it is driven with comes on top.

    Whatever is asked of it is asked about the rest that it has there.
    """
    for name, value in values.items():
        if name not in loop.externals:
            raise DesignError("not an external input", found=repr(name), known=loop.externals)
        whole = _free_name(loop, f"{name}@held")
        elements = tuple(_reads_instead(element, name, whole) for element in loop.elements)
        total = Expression(f"input + ({float(value)!r})").renamed({"input": name})
        sum_ = Element(whole, Gain(), {"input": total}, {"output": whole})
        loop = replace(loop, elements=(*elements, sum_), units={**loop.units, whole: loop.units.get(name, "")})
    return loop


def disturbed_at(loop: Loop, signal: str) -> tuple[Loop, str]:
    """The loop with a new external input added to a signal behind its writer, and that input's name."""
    raw, name = f"{signal}@undisturbed", f"{signal}@disturbance"
    if signal not in loop.writers:
        raise DesignError("unknown signal", found=repr(signal), known=loop.signals)
    element = loop[loop.writers[signal][0]]
    outputs = {port: raw if written == signal else written for port, written in element.outputs.items()}
    total = Expression("raw + added").renamed({"raw": raw, "added": name})
    sum_ = Element(f"sum@{signal}", Gain(), {"input": total}, {"output": signal})
    disturbed = loop.replaced(replace(element, outputs=outputs))
    return replace(disturbed, elements=(*disturbed.elements, sum_)), name
