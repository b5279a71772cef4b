"""Which effects can act where in a segment: the catalogue at every port, one name for one thing."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Block, Continuous, Sampled, flat_values
from delaytools.blocks.equations import Equations
from delaytools.blocks.integrator import Integrator
from delaytools.loop.loop import Element, Loop
from delaytools.loop.network import position_of, pushed_by
from delaytools.loop.port import Port, derivative_states, ports, read_at, written_at, written_behind
from delaytools.loop.segments import Segment
from delaytools.loop.values import resolve

__all__ = ["Spot", "changes_unit", "spots", "value_spots"]

SHAPES = ("dead_band", "backlash", "saturation", "rate_limit", "quantization", "sample_hold")
LATE = ("delay", "lag")
GAINS = ("scale_factor", "gain_drift", "transient_gain")
FORCES = ("constant_disturbance", "coulomb_friction", "load_dependent_friction",
          "cubic_damping", "quadratic_drag")  # fmt: skip
FED = ("cross_coupling", "flexible_mode")


@final
@dataclass(frozen=True)
class Spot:
    """A kind of effect at a port; what needs a source signal is listed once, without it."""

    kind: str
    port: Port


def changes_unit(loop: Loop, element: Element) -> bool:
    """Whether what leaves the block has another unit than what enters (a sensor, table or actuator keeps it)."""
    read = (read_at(loop, port) for port in ports(element) if port.kind == "input")
    entering = {loop.units[name] for x in read for name in x.names if name in loop.units}
    leaving = {loop.units.get(written_behind(loop, name), "") for name in element.outputs.values()}
    return len(element.inputs) != 1 or len(element.outputs) != 1 or entering != leaving


def spots(segment: Segment) -> tuple[Spot, ...]:
    """Every effect of the catalogue at every port of the segment where it means something of its own."""
    found: list[Spot] = []
    for name in segment.blocks:
        element = segment.loop[name]
        changed = changes_unit(segment.loop, element)
        for port in (port for port in ports(element) if _goes_on(segment, port)):
            found.extend(Spot(kind, port) for kind in _kinds(segment.loop, element, port, changed))
    return tuple(found)


def _goes_on(segment: Segment, port: Port) -> bool:
    """Whether a port's signal is measured or enters a block: of an output that only shows something nothing follows."""
    signal = written_at(segment.loop, port) if port.kind == "output" else ""
    entering = (x.names for element in segment.loop.elements for x in element.inputs.values())
    return not signal or signal in segment.exits or any(signal in names for names in entering)


def _kinds(loop: Loop, element: Element, port: Port, changed: bool) -> tuple[str, ...]:
    sampled = isinstance(element.block, Sampled)
    match port.kind:
        case "input":
            if changed or sampled:
                fed = ("flexible_mode",) if _is_named_at_a_derivative(loop, element, port.name) else FED
                return (*LATE, *SHAPES, *GAINS, *fed, *(("bias",) if sampled else ()))
            return (*LATE, *SHAPES, "transient_gain", *FED)
        case "output":
            shown = ("bias", "periodic_interference", *FED, *SHAPES)
            if sampled:
                return (*shown, *LATE, *GAINS, "dropped_frames")
            return shown if changed and not _sensor_like(element) else (*shown, *GAINS)
        case "rate":
            return ("rate_limit",)
        case "derivative":
            if _is_kinematic(loop, element, port.name):
                return ()
            stiff = ("cubic_stiffness",) if _has_position(loop, element, port.name) else ()
            forces = FORCES if not isinstance(element.block, Integrator) else ("constant_disturbance",)
            return (*forces, *stiff, "cross_coupling")
    return ()


def _is_named_at_a_derivative(loop: Loop, element: Element, name: str) -> bool:
    """Whether what is added at an input is the same as what is added, in its own unit, to a state's derivative."""
    block = _resolved(loop, element)
    return isinstance(block, Continuous) and pushed_by(block, name) in derivative_states(element)


def _sensor_like(element: Element) -> bool:
    return len(element.outputs) > 1


def _is_kinematic(loop: Loop, element: Element, state: str) -> bool:
    """Whether the derivative of a state is another state and nothing else: no force acts there."""
    block = _resolved(loop, element)
    return isinstance(block, Continuous) and any(
        other != state and position_of(block, other) == state for other in block.states
    )


def _has_position(loop: Loop, element: Element, state: str) -> bool:
    block = _resolved(loop, element)
    return isinstance(block, Continuous) and position_of(block, state) != ""


def _resolved(loop: Loop, element: Element) -> Block:
    """The block with the loop's numbers in it."""
    return resolve(Loop((element,), loop.parameters, loop.units, loop.frame)).elements[0].block


def value_spots(segment: Segment) -> tuple[tuple[str, str], ...]:
    """(block, value) for every number of a block that may be another: its static gain and its start left out."""
    found: list[tuple[str, str]] = []
    for name in segment.blocks:
        block = segment.loop[name].block
        left_out = {"gain", "initial", *_start_names(block), *_scaling_names(block)}
        found.extend((name, value) for value in flat_values(block) if value.partition("[")[0] not in left_out
                     and value not in left_out)  # fmt: skip
    return tuple(found)


def _start_names(block: object) -> tuple[str, ...]:
    return block.states if isinstance(block, Equations) else ()


def _scaling_names(block: object) -> tuple[str, ...]:
    """The leading coefficient of a denominator, and a numerator of one number: they only scale."""
    values = flat_values(block)
    leading = ("denominator[0]",) if "denominator[0]" in values else ()
    alone = ("numerator[0]",) if "numerator[0]" in values and "numerator[1]" not in values else ()
    return leading + alone
