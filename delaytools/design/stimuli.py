"""The design's [inputs] as stimuli of a loop's external inputs."""

from delaytools.design.design import Design
from delaytools.design.faults import Faults
from delaytools.design.inputs import Setting, stimulus
from delaytools.design.parameters import Parameters, read_parameters
from delaytools.loop.loop import Loop
from delaytools.loop.values import parameter_values
from delaytools.signals.stimulus import Stimulus

__all__ = ["design_stimuli"]


def design_stimuli(design: Design, loop: Loop, *, seed: int = 1) -> dict[str, Stimulus]:
    """External input -> stimulus, for the inputs that the design drives; raises DesignError naming every fault."""
    found: dict[str, Stimulus] = {}
    faults = Faults(design.name)
    dimensions = read_parameters(design.data.get("parameters", {}), faults).dimensions
    values = {name: float(item) for name, item in parameter_values(loop, {}).items()}
    for number, (name, table) in enumerate(design.tables.inputs.items()):
        with faults.at(f"inputs.{name}"):
            setting = Setting(
                loop.units.get(name, ""), loop.frame, seed + number, Parameters(values, dimensions)
            )
            found[name] = stimulus(table, setting)
    faults.settle()
    return found
