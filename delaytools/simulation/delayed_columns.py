"""Constant delays of measured columns: the column read so much earlier, no history of steps."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from delaytools.blocks.block import Follower
from delaytools.blocks.delay import Delay
from delaytools.loop.loop import Element, Loop
from delaytools.signals.expression import Expression
from delaytools.signals.stimulus import Column, Stimulus

__all__ = ["delayed_columns", "driven_late", "without"]


def delayed_columns(loop: Loop, stimuli: Mapping[str, Stimulus]) -> tuple[Element, ...]:
    """Elements that delay a column by a number, or what another one of these writes; in the order of the wire.

    A delay has no state of its own there: u(t - τ) of rows at tₖ is a column whose rows are at tₖ + τ. Held columns
    alone where something follows what enters it (a backlash): where a smooth one turns round is a matter of steps.
    """
    follows = any(isinstance(e.block, Follower) for e in loop.elements)
    given = {name: one for name in loop.externals if isinstance(one := stimuli.get(name), Column)}
    columns = {name for name, one in given.items() if one.held or not follows}
    found: list[Element] = []
    waiting = [e for e in loop.transports if isinstance(e.block, Delay) and not isinstance(e.block.delay, Expression)]
    while ready := [e for e in waiting if e.inputs["input"].text in columns]:
        found += ready
        columns |= {e.outputs["output"] for e in ready}
        waiting = [e for e in waiting if e not in ready]
    return tuple(found)


def without(loop: Loop, elements: Sequence[Element]) -> Loop:
    """The loop without these elements, whose outputs come from outside then."""
    gone = {e.name for e in elements}
    return replace(loop, elements=tuple(e for e in loop.elements if e.name not in gone))


def driven_late(
    stimuli: Mapping[str, Stimulus], elements: Sequence[Element], seconds: Mapping[str, float]
) -> dict[str, Stimulus]:
    """The stimuli and what these elements write of them; seconds: element -> s."""
    found = dict(stimuli)
    for element in elements:
        found[element.outputs["output"]] = found[element.inputs["input"].text].late(seconds[element.name])
    return found
