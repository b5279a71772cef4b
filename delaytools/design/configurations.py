"""A design's tables with a configuration put in: overrides by dotted path, and effects of its own."""

import copy
import re
from collections.abc import Mapping
from typing import Any

from delaytools.blocks.block import specifications
from delaytools.design.catalogue import BLOCKS, EFFECTS
from delaytools.design.design import Design
from delaytools.signals.trouble import DelaytoolsError, DesignError, shown

__all__ = ["configured", "effect_places", "override"]

_ELEMENT = re.compile(r"^(.*?)((?:\[\d+\])*)$")
_INSIDE = ("parameters", "states")  # tables of a block or effect of formulas whose entries have the path BLOCK.NAME


def configured(design: Design, configuration: str | None) -> dict[str, Any]:
    """The design's tables with a configuration's overrides and effects put in, base first, then what it extends."""
    data = copy.deepcopy(design.data)
    for name in reversed(_chain(design, configuration)):
        table = design.tables.configurations[name]
        for path, raw in table.set.items():
            try:
                override(data, path, raw)
            except DelaytoolsError as error:
                raise error.at(f"configurations.{name}.set") from error
        data.setdefault("effects", []).extend(effect.model_dump() for effect in table.effects)
    return data


def effect_places(design: Design, configuration: str | None) -> list[str]:
    """Where each effect of a configured design stands in the file: `effects.0`, `configurations.NAME.effects.0`."""
    places = [f"effects.{index}" for index in range(len(design.tables.effects))]
    for name in reversed(_chain(design, configuration)):
        count = len(design.tables.configurations[name].effects)
        places += [f"configurations.{name}.effects.{index}" for index in range(count)]
    return places


def _chain(design: Design, configuration: str | None) -> list[str]:
    chain: list[str] = []
    tables = design.tables.configurations
    while configuration is not None:
        where = f"configurations.{chain[-1]}.extend" if chain else ""
        if configuration not in tables:
            advice = "" if tables else "the design has no [configurations]"
            raise DesignError(
                "unknown configuration",
                where=where,
                found=repr(configuration),
                known=sorted(tables),
                advice=advice,
            )
        if configuration in chain:
            raise DesignError(
                "configurations extend each other in a circle",
                where=where,
                found=" -> ".join([*chain, configuration]),
                advice="leave out one extend",
            )
        chain.append(configuration)
        configuration = tables[configuration].extend
    return chain


def override(data: dict[str, Any], path: str, raw: Any) -> None:
    """Put a value at `BLOCK.VALUE`, `parameters.NAME` or `effects.N.VALUE`; raises DesignError where nothing is."""
    if isinstance(raw, Mapping) and not any("." in key for key in raw) and "." not in path:
        raise DesignError(
            "a path is one name in quotes",
            found=f"{path} = {shown(dict(raw))}",
            advice=f'write "{path}.{next(iter(raw), "VALUE")}" = …',
        )
    first, _, rest = path.partition(".")
    home = _home(data, first, rest, path)
    key = rest.partition(".")[2] if first == "effects" else rest
    prefix = path[: len(path) - len(key)] if key else f"{path.rstrip('.')}."
    match = _ELEMENT.match(key)
    assert match is not None
    name, places = match.group(1), [int(i) for i in re.findall(r"\d+", match.group(2))]
    known = _known_values(first, home)
    if first != "parameters":
        home = next((home[table] for table in _INSIDE if _has(home, table, name)), home)
    if name not in known and name not in home:
        advice = "" if known else "there is nothing to override here"
        raise DesignError(
            "unknown path", found=repr(path), known=[f"{prefix}{one}" for one in known], advice=advice
        )
    _put(home, name, places, raw, path)


def _has(home: Mapping[str, Any], table: str, name: str) -> bool:
    return home.get("type") in ("equations", "formula") and name in home.get(table, {})


def _home(data: dict[str, Any], first: str, rest: str, path: str) -> dict[str, Any]:
    if first == "parameters":
        return data.get("parameters", {})
    if first == "effects":
        index = rest.partition(".")[0]
        effects = data.get("effects", [])
        if not index.isdigit() or int(index) >= len(effects):
            known = [f"effects.{i}" for i in range(len(effects))]
            advice = "count from 0" if known else "the design has no [[effects]] before this configuration"
            raise DesignError("unknown path", found=repr(path), known=known, advice=advice)
        return effects[int(index)]
    blocks = data.get("blocks", {})
    if first not in blocks:
        known = [*sorted(blocks), "parameters", "effects"]
        advice = "write BLOCK.VALUE, parameters.NAME or effects.N.VALUE"
        raise DesignError("unknown path", found=repr(path), known=known, advice=advice)
    return blocks[first]


def _known_values(first: str, home: Mapping[str, Any]) -> list[str]:
    """The names that may follow in a path, type and wiring left out."""
    if first == "parameters":
        return sorted(home)
    kind = home.get("type")
    if kind in ("equations", "formula"):
        return sorted({**home.get("parameters", {}), **home.get("states", {})})
    catalogue: Mapping[str, type] = EFFECTS if first == "effects" else BLOCKS
    found = catalogue.get(kind) if isinstance(kind, str) else None
    own = {key for key in home if key not in ("type", "at", "input", "inputs", "output", "outputs")}
    return sorted(own | (set(specifications(found)) if found else set()))


def _put(home: dict[str, Any], name: str, places: list[int], raw: Any, path: str) -> None:
    if not places:
        home[name] = raw
        return
    target: Any = home.get(name)
    try:
        for place in places[:-1]:
            target = target[place]
        if not isinstance(target, list):
            raise TypeError
        target[places[-1]] = raw
    except (IndexError, TypeError) as error:
        advice = "elements are counted from 0"
        raise DesignError(
            "no such element", found=repr(path), known=_elements(home.get(name), path), advice=advice
        ) from error


def _elements(raw: Any, path: str) -> list[str]:
    name = path.partition("[")[0]
    return [f"{name}[{index}]" for index in range(len(raw))] if isinstance(raw, list) else [name]
