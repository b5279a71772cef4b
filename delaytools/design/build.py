"""Design → Loop: blocks in their places, effects in file order, one configuration, or the loop that flies."""

import copy
import re
from collections.abc import Mapping
from typing import Any

import casadi as ca

from delaytools.blocks.block import CASADI
from delaytools.design.catalogue import BLOCKS
from delaytools.design.design import Design
from delaytools.design.elements import make_element
from delaytools.design.entries import apply_effect
from delaytools.design.faults import Faults
from delaytools.design.values import number, parameter
from delaytools.loop.edit import remove
from delaytools.loop.loop import Element, Loop
from delaytools.loop.network import network
from delaytools.loop.port import find_port
from delaytools.loop.values import parameter_values, resolve, value_paths
from delaytools.signals.trouble import DelaytoolsError, DesignError, nearest
from delaytools.signals.units import unit

__all__ = ["build", "configured", "flight", "warnings"]

_ELEMENT = re.compile(r"^(.*?)((?:\[\d+\])*)$")


def configured(design: Design, configuration: str | None) -> dict[str, Any]:
    """The design's tables with a configuration's overrides and effects put in, base first, then what it extends."""
    data = copy.deepcopy(design.data)
    for name in reversed(_chain(design, configuration)):
        table = design.tables.configurations[name]
        for path, raw in table.set.items():
            try:
                override(data, path, raw)
            except DelaytoolsError as error:
                raise error.at(f"{design.name}: configurations.{name}.set") from error
        data.setdefault("effects", []).extend(effect.model_dump() for effect in table.effects)
    return data


def _chain(design: Design, configuration: str | None) -> list[str]:
    chain: list[str] = []
    tables = design.tables.configurations
    while configuration is not None:
        if configuration not in tables:
            raise DesignError(
                "unknown configuration", where=design.name, found=repr(configuration), known=sorted(tables)
            )
        if configuration in chain:
            raise DesignError(
                "configurations extend each other in a circle", where=design.name, found=" -> ".join(chain)
            )
        chain.append(configuration)
        configuration = tables[configuration].extend
    return chain


def override(data: dict[str, Any], path: str, raw: Any) -> None:
    """Put a value at `BLOCK.VALUE`, `parameters.NAME` or `effects.N.VALUE`; raises DesignError where nothing is."""
    first, _, rest = path.partition(".")
    if first == "parameters":
        home, key = data.get("parameters", {}), rest
    elif first == "effects":
        index, _, key = rest.partition(".")
        effects = data.get("effects", [])
        if not index.isdigit() or int(index) >= len(effects):
            known = [f"effects.{i}" for i in range(len(effects))]
            raise DesignError("unknown effect", found=repr(path), known=known)
        home = effects[int(index)]
    else:
        blocks = data.get("blocks", {})
        if first not in blocks:
            raise DesignError(
                "unknown path", found=repr(path), known=[*sorted(blocks), "parameters", "effects"]
            )
        home, key = blocks[first], rest
    _put(home, key, raw, path)


def _put(home: dict[str, Any], key: str, raw: Any, path: str) -> None:
    match = _ELEMENT.match(key)
    assert match is not None
    name, places = match.group(1), [int(i) for i in re.findall(r"\d+", match.group(2))]
    kind = home.get("type")
    known = set(home) | (set(_values_of(kind)) if isinstance(kind, str) else set())
    if name not in known:
        raise DesignError("unknown value", found=repr(path), known=sorted(known - {"type"}))
    if not places:
        home[name] = raw
        return
    target: Any = home[name]
    try:
        for place in places[:-1]:
            target = target[place]
        target[places[-1]] = raw
    except (IndexError, TypeError) as error:
        raise DesignError("no such element", found=repr(path), advice="count from 0") from error


def _values_of(kind: str) -> list[str]:
    from_catalogue = BLOCKS.get(kind)
    return [] if from_catalogue is None else list(from_catalogue.__dataclass_fields__)  # type: ignore[attr-defined]


def build(design: Design, configuration: str | None = None) -> Loop:
    """The loop of a design, in one configuration; raises DesignError that names every fault found."""
    data = configured(design, configuration)
    faults = Faults(design.name)
    parameters = _parameters(data, faults)
    units = _units(data, faults)
    with faults.at("frame"):
        frame = number(data.get("frame", 1e-3), "s")
        if not frame > 0:
            raise DesignError("the frame must be positive", found=repr(data.get("frame")))
    faults.settle()
    elements = []
    for name, table in data.get("blocks", {}).items():
        with faults.at(""):
            elements.append(make_element(name, table, units=units, parameters=parameters))
    faults.settle()
    loop = Loop(tuple(elements), parameters, units, frame, design.title)
    _check_wiring(loop, faults)
    for index, table in enumerate(data.get("effects", [])):
        with faults.at(f"effects.{index}"):
            loop = apply_effect(loop, table, index, known=set(units))
    faults.settle()
    with faults.at(""):
        network(resolve(loop))
    faults.settle()
    return loop


def _parameters(data: Mapping[str, Any], faults: Faults) -> dict[str, Any]:
    raw = data.get("parameters", {})
    found = {}
    for name, item in raw.items():
        with faults.at(f"parameters.{name}"):
            found[name] = parameter(item, raw)
    with faults.at(""):
        parameter_values(Loop((), found), {})
    return found


def _units(data: Mapping[str, Any], faults: Faults) -> dict[str, str]:
    for name, symbol in data.get("signals", {}).items():
        with faults.at(f"signals.{name}"):
            unit(symbol)
    return dict(data.get("signals", {}))


def _check_wiring(loop: Loop, faults: Faults) -> None:
    clash = sorted(set(loop.parameters) & set(loop.writers))
    if clash:
        with faults.at(""):
            raise DesignError(
                "one name for a signal and a parameter", found=", ".join(clash), advice="rename one of them"
            )
    for element in loop.elements:
        for port, expression in element.inputs.items():
            with faults.at(f"blocks.{element.name}.{port}"):
                _check_linear(loop, element, port, expression.names)
    with faults.at(""):
        _one_writer(loop)


def _one_writer(loop: Loop) -> None:
    seen: dict[str, str] = {}
    for element in loop.elements:
        for signal in element.outputs.values():
            if signal in seen:
                raise DesignError(
                    "two writers of one signal",
                    where=f"signal {signal}",
                    found=f"blocks {seen[signal]} and {element.name}",
                    advice="give each block an output signal of its own",
                )
            seen[signal] = element.name


def _check_linear(loop: Loop, element: Element, port: str, names: tuple[str, ...]) -> None:
    symbols = {name: ca.SX.sym(name) for name in names if name not in loop.parameters}
    if not symbols:
        raise DesignError(
            "an input reads no signal", found=repr(element.inputs[port].text), advice="name a signal"
        )
    numbers = parameter_values(loop, {})
    formula = ca.SX(element.inputs[port].evaluate({**numbers, **symbols}, CASADI))
    if not ca.is_linear(formula, ca.vertcat(*symbols.values())):
        raise DesignError(
            "an input is a signal or a linear combination of signals",
            found=repr(element.inputs[port].text),
            advice="put the formula into an equations block",
        )


def flight(design: Design, configuration: str | None = None) -> Loop:
    """The loop that flies: the blocks and effects of [flight] taken out, with the effects at those blocks' ports."""
    loop = build(design, configuration)
    everywhere = _all_effects(design)
    for name in design.tables.flight.remove:
        if "@" in name:
            if not _has(loop, name) and name not in everywhere:
                raise DesignError(
                    "unknown effect",
                    where=f"{design.name}: flight.remove",
                    found=repr(name),
                    known=sorted(everywhere),
                )
            loop = remove(loop, name) if _has(loop, name) else loop
        else:
            with_effects = [n for n in _effects_in(loop) if n.partition("@")[2].partition(".")[0] == name]
            try:
                loop = remove(loop, name)
            except DesignError as error:
                raise error.at(f"{design.name}: flight.remove") from error
            for effect in with_effects:
                loop = remove(loop, effect) if _has(loop, effect) else loop
    return loop


def _effects_in(loop: Loop) -> list[str]:
    inserted = [e.name for e in loop.elements if "@" in e.name]
    return inserted + [p.name for e in loop.elements for p in e.modifiers]


def _has(loop: Loop, name: str) -> bool:
    return name in _effects_in(loop)


def _all_effects(design: Design) -> set[str]:
    tables = [*design.tables.effects, *(e for c in design.tables.configurations.values() for e in c.effects)]
    return {f"{table.type}@{table.at}" for table in tables}


def warnings(design: Design, loop: Loop) -> tuple[str, ...]:
    """What is odd but no error: declared signals that nothing uses, inputs without a drive or a declaration."""
    found = []
    used = set(loop.signals) | {s for e in loop.elements for p in e.modifiers for s in p.modifier.sources}
    for name in design.tables.signals:
        if name not in used:
            found.append(f"{design.name}: signals.{name} is declared but not used")
    for name in loop.externals:
        if design.tables.signals and name not in design.tables.signals and name not in design.tables.inputs:
            close = nearest(name, [*design.tables.signals])
            hint = f"; nearest declared: {close}" if close else ""
            found.append(f"{design.name}: {name} is an external input that [signals] does not declare{hint}")
    return tuple(found)


def check_paths(design: Design, loop: Loop) -> None:
    """Raises DesignError where [tolerance], [inputs], [analysis] or [tuning] name what is not there."""
    faults = Faults(design.name)
    paths = value_paths(loop)
    for path in design.tables.tolerance:
        with faults.at(f"tolerance.{path!r}"):
            _known_path(path, paths)
    for name in design.tables.inputs:
        with faults.at(f"inputs.{name}"):
            if name not in loop.externals:
                raise DesignError("not an external input", found=repr(name), known=loop.externals)
    with faults.at("analysis.at"):
        at = design.tables.analysis.at
        if at is not None and at not in loop.signals:
            raise DesignError("unknown signal", found=repr(at), known=loop.signals)
    with faults.at("analysis.delay_at"):
        if design.tables.analysis.delay_at is not None:
            find_port(loop, design.tables.analysis.delay_at)
    for name in design.tables.tuning.vary:
        with faults.at(f"tuning.vary.{name}"):
            _known_path(name if "." in name else f"parameters.{name}", paths)
    faults.settle()


def _known_path(path: str, paths: Mapping[str, float]) -> None:
    if path not in paths and f"parameters.{path}" not in paths:
        raise DesignError("no such value in the design", found=repr(path), known=sorted(paths))
