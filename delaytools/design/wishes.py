"""What a design says beside its loop ([inputs], [analysis], [tolerance], [tuning], …), held against the loop."""

import math
from collections.abc import Mapping
from typing import Any

from delaytools.blocks.block import specifications
from delaytools.design.configurations import configured
from delaytools.design.design import Design
from delaytools.design.entries import check_type
from delaytools.design.faults import Faults
from delaytools.design.stimuli import read_stimuli
from delaytools.design.values import Units, number
from delaytools.loop.loop import Loop
from delaytools.loop.port import find_port, first_unit
from delaytools.loop.values import value_paths
from delaytools.signals.trouble import DesignError, UnitError, nearest, shown
from delaytools.signals.units import Unit, quantity, same_dimension, unit

__all__ = ["check_paths", "unit_at", "warnings"]


def warnings(design: Design, loop: Loop) -> tuple[str, ...]:
    """What is odd but no error: declared signals that nothing uses, inputs and log columns without a declaration."""
    found, tables = [], design.tables
    used = set(loop.signals) | {s for e in loop.elements for p in e.modifiers for s in p.modifier.sources}
    for name in tables.signals:
        if name not in used:
            found.append(f"{design.name}: signals.{name} is declared but not used{_hint(name, loop.signals)}")
    for name in loop.externals:
        declared = name in tables.signals or name in tables.inputs or name in loop.random
        if tables.signals and not declared:
            hint = _hint(name, tables.signals, "declared")
            found.append(f"{design.name}: {name} is an external input that [signals] does not declare{hint}")
    for column, name in tables.log.columns.items():
        if name not in loop.signals and name not in tables.signals:
            hint = _hint(name, loop.signals)
            found.append(
                f"{design.name}: log.columns.{column} names {name}, which is no signal of the loop{hint}"
            )
    return tuple(found)


def _hint(name: str, known: Any, what: str = "") -> str:
    close = nearest(name, known)
    return f"; nearest {what}: {close}".replace(" :", ":") if close else ""


def check_paths(design: Design, loop: Loop) -> None:
    """Raises DesignError, naming every fault, where the tables beside the loop name or say what cannot be."""
    faults = Faults(design.name)
    paths = value_paths(loop)
    for path, raw in design.tables.tolerance.items():
        with faults.at(f'tolerance."{path}"'):
            _known_path(path, paths)
            _check_tolerance(raw, unit_at(loop, path))
    sources = _sources(design)
    for name in design.tables.inputs:
        with faults.at(f"inputs.{name}"):
            if name not in loop.externals and (name in loop.writers or name not in sources):
                raise DesignError(
                    "not an external input",
                    found=repr(name),
                    known=loop.externals,
                    advice=_why_not(loop, name),
                )
    read_stimuli(design, loop, faults)
    _check_analysis(design, loop, faults)
    _check_simulation(design, faults)
    _check_tuning(design, paths, faults)
    _check_configurations(design, loop, faults)
    faults.settle()


def _sources(design: Design) -> set[str]:
    """Signals that an effect of the design or of any configuration reads."""
    tables = [*design.tables.effects, *(e for c in design.tables.configurations.values() for e in c.effects)]
    return {raw for table in tables for raw in table.model_dump().values() if isinstance(raw, str)}


def _why_not(loop: Loop, name: str) -> str:
    if name in loop.writers:
        return f"{name} is written by the block {loop.writers[name][0]}"
    return "no block reads a signal of this name"


def _known_path(path: str, paths: Mapping[str, float]) -> None:
    if path not in paths and f"parameters.{path}" not in paths:
        bare = [one.removeprefix("parameters.") for one in paths]
        raise DesignError("no such value in the design", found=repr(path), known=sorted(bare))


def unit_at(loop: Loop, path: str) -> Unit | None:
    """The unit in which a block's value is held (None: not known)."""
    name, _, value = path.partition(".")
    element = next((e for e in loop.elements if e.path == name), None)
    spec = specifications(element.block).get(value.partition("[")[0]) if element else None
    if element is None or spec is None:
        return None
    return Units(first_unit(loop, element)).resolve(spec.unit)


def _check_tolerance(raw: Any, held_in: Unit | None) -> None:
    parts = quantity(raw) if isinstance(raw, str) else (float(raw), "")
    if parts is None:
        raise DesignError("a tolerance is a number or a quantity", found=shown(raw), advice='write "6 %"')
    given = unit(parts[1])
    if any(given.powers) and held_in is not None and not same_dimension(given, held_in):
        wanted = f'write "6 %", or give it in {held_in.symbol}' if held_in.symbol else 'write "6 %"'
        raise UnitError("wrong dimension", found=shown(raw), advice=wanted)
    if not (parts[0] > 0 and math.isfinite(parts[0])):
        raise DesignError(
            "a tolerance is above 0", found=shown(raw), advice="leave out what is known exactly"
        )


def _check_analysis(design: Design, loop: Loop, faults: Faults) -> None:
    table = design.tables.analysis
    with faults.at("analysis.at"):
        if table.at is not None and table.at not in loop.writers:
            known = [name for name in loop.signals if name in loop.writers]
            problem = "no block writes this signal" if table.at in loop.externals else "unknown signal"
            advice = "the loop is opened where a block writes a signal"
            raise DesignError(problem, found=repr(table.at), known=known, advice=advice)
    with faults.at("analysis.delay_at"):
        if table.delay_at is not None:
            port = find_port(loop, table.delay_at)
            if port.kind not in ("input", "output"):
                raise DesignError(
                    "an extra delay acts at an input or output",
                    found=repr(table.delay_at),
                    advice=f"write {port.element}.input",
                )
    for index, raw in enumerate(table.delay or []):
        with faults.at(f"analysis.delay.{index}"):
            if not 0 <= number(raw, "s") < math.inf:
                raise DesignError("a delay is finite and not negative", found=shown(raw))


def _check_simulation(design: Design, faults: Faults) -> None:
    table = design.tables.simulation
    with faults.at("simulation.duration"):
        if not 0 < number(table.duration, "s") < math.inf:
            raise DesignError("a run lasts longer than 0 s", found=shown(table.duration))
    with faults.at("simulation.seed"):
        if table.seed < 0:
            raise DesignError("a seed is 0 or more", found=f"{table.seed}")
    with faults.at("simulation.substeps"):
        if table.substeps is not None and table.substeps < 1:
            raise DesignError("substeps are 1 or more", found=f"{table.substeps}")


def _check_tuning(design: Design, paths: Mapping[str, float], faults: Faults) -> None:
    for name, raw in design.tables.tuning.vary.items():
        with faults.at(f"tuning.vary.{name}"):
            _known_path(name, paths)
            ends = [_end(item) for item in raw]
            if len(ends) != 2 or not ends[0] < ends[1]:
                raise DesignError(
                    "a range runs from a lower to a higher value", found=shown(raw), advice="write [0.1, 2.0]"
                )
    for index, goal in enumerate(design.tables.tuning.goals):
        with faults.at(f"tuning.goals.{index}"):
            if not isinstance(goal.get("type"), str):
                raise DesignError("missing required value", where="type", advice='give type = "phase_margin"')


def _end(raw: Any) -> float:
    parts = quantity(raw) if isinstance(raw, str) else (float(raw), "")
    if parts is None:
        raise DesignError("a number or a quantity is wanted", found=shown(raw))
    return parts[0] * unit(parts[1]).scale


def _check_configurations(design: Design, loop: Loop, faults: Faults) -> None:
    said: set[str] = set()
    for name, table in design.tables.configurations.items():
        single = Faults()
        with single.at(""):
            configured(design, name)
        for index, effect in enumerate(table.effects):
            with single.at(f"configurations.{name}.effects.{index}"):
                check_type(effect.type)
                find_port(loop, effect.at)
        faults.found.extend(error for error in single.found if str(error) not in said)
        said.update(str(error) for error in single.found)
