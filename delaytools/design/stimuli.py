"""The design's [inputs] as stimuli of a loop's external inputs."""

from delaytools.design.design import Design
from delaytools.design.faults import Faults
from delaytools.design.inputs import Setting, stimulus
from delaytools.design.parameters import Parameters, read_parameters
from delaytools.loop.loop import Loop
from delaytools.loop.values import parameter_values
from delaytools.signals.stimulus import Stimulus

__all__ = ["design_stimuli", "read_stimuli"]


def design_stimuli(design: Design, loop: Loop, *, seed: int = 1) -> dict[str, Stimulus]:
    """External input -> stimulus, for the inputs that the design drives; raises DesignError naming every fault.

    Entries for signals that are no external input of this loop are left out (an effect of a configuration may read
    them).
    """
    faults = Faults(design.name)
    found = read_stimuli(design, loop, faults, seed=seed)
    faults.settle()
    return found


def read_stimuli(design: Design, loop: Loop, faults: Faults, *, seed: int = 1) -> dict[str, Stimulus]:
    """The stimuli of [inputs]; what is wrong in the table goes to `faults`."""
    found: dict[str, Stimulus] = {}
    dimensions = read_parameters(design.data.get("parameters", {}), faults).dimensions
    values = {name: float(item) for name, item in parameter_values(loop, {}).items()}
    for number, (name, table) in enumerate(design.tables.inputs.items()):
        if name not in loop.externals:
            continue
        with faults.at(f"inputs.{name}"):
            named = Parameters(values, dimensions)
            setting = Setting(loop.units.get(name, ""), loop.frame, seed + number, named)
            found[name] = stimulus(table, setting)
    return found
