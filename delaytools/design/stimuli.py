"""The design's [inputs] as stimuli of a loop's external inputs."""

from delaytools.design.design import Design
from delaytools.design.faults import Faults
from delaytools.design.inputs import stimulus
from delaytools.loop.loop import Loop
from delaytools.signals.stimulus import Stimulus

__all__ = ["design_stimuli"]


def design_stimuli(design: Design, loop: Loop, *, seed: int = 1) -> dict[str, Stimulus]:
    """External input -> stimulus, for the inputs that the design drives; raises DesignError naming every fault."""
    found: dict[str, Stimulus] = {}
    faults = Faults(design.name)
    for number, (name, table) in enumerate(design.tables.inputs.items()):
        with faults.at(f"inputs.{name}"):
            unit = loop.units.get(name, "")
            found[name] = stimulus(table, signal_unit=unit, frame=loop.frame, seed=seed + number)
    faults.settle()
    return found
