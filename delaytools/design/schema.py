"""The shape of a design file: which tables and keys there are."""

from typing import Any, Literal, final

from pydantic import BaseModel, ConfigDict, ValidationError

from delaytools.signals.trouble import DesignError, nearest, shown

__all__ = ["DesignTable", "check_shape"]

Quantity = float | str


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class _Open(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)


@final
class BlockTable(_Open):
    """[blocks.NAME]: the type, the wiring, and the values that the type takes."""

    type: str


@final
class EffectTable(_Open):
    """[[effects]]: the type, the port, and the values that the type takes."""

    type: str
    at: str


@final
class ConfigurationTable(_Table):
    """[configurations.NAME]: overrides by dotted path, and effects of its own."""

    description: str = ""
    extend: str | None = None
    set: dict[str, Any] = {}
    effects: list[EffectTable] = []


@final
class SimulationTable(_Table):
    """[simulation]."""

    duration: Quantity = 10.0
    seed: int = 1
    substeps: int | None = None


@final
class AnalysisTable(_Table):
    """[analysis]: defaults of the commands."""

    at: str | None = None
    delay_at: str | None = None
    delay: list[Quantity] | None = None


@final
class FlightTable(_Table):
    """[flight]: what the bench adds, taken out."""

    remove: list[str] = []


@final
class TuningTable(_Table):
    """[tuning]: what may move, and what is wished."""

    configuration: str | None = None
    vary: dict[str, list[Quantity]] = {}
    goals: list[dict[str, Any]] = []


@final
class LogTable(_Table):
    """[log]: how a log's columns map to signals, and what is known of the logs.

    held, smooth: signals that keep their value between rows, or that have no corners between them. start: whether a
    log begins at rest, or with states to be fitted. window: length of pieces that each begin anew. where: rows that
    count, as comparisons ("speed > 0.8 and speed < 2").
    """

    time: str | None = None
    columns: dict[str, str] = {}
    held: list[str] = []
    smooth: list[str] = []
    start: Literal["rest", "free"] = "rest"
    window: Quantity | None = None
    where: str | None = None


@final
class DesignTable(_Table):
    """A whole design file."""

    title: str = ""
    frame: Quantity = 1e-3
    parameters: dict[str, Quantity] = {}
    signals: dict[str, str] = {}
    blocks: dict[str, BlockTable] = {}
    effects: list[EffectTable] = []
    configurations: dict[str, ConfigurationTable] = {}
    tolerance: dict[str, Quantity] = {}
    inputs: dict[str, dict[str, Any]] = {}
    simulation: SimulationTable = SimulationTable()
    analysis: AnalysisTable = AnalysisTable()
    flight: FlightTable = FlightTable()
    tuning: TuningTable = TuningTable()
    log: LogTable = LogTable()


def check_shape(data: dict[str, Any]) -> tuple[DesignTable, list[DesignError]]:
    """The tables of a design, and every fault of their shape."""
    try:
        return DesignTable.model_validate(data), []
    except ValidationError as error:
        found: dict[str, DesignError] = {}
        for item in error.errors():
            fault = _fault(item)
            found.setdefault(fault.where, fault)
        return DesignTable(), list(found.values())


# pydantic's words for what it wanted -> ours, and what to write
_WANTED = {
    "float_type": ("a number or a quantity is wanted here", 'write 0.5 or "5 ms"'),
    "string_type": ("text is wanted here", "write it in quotes"),
    "int_type": ("a whole number is wanted here", "write 1"),
    "int_from_float": ("a whole number is wanted here", "write 1"),
    "list_type": ("a list is wanted here", "write it in brackets: [ … ]"),
    "dict_type": ("a table is wanted here", "write it in braces: { name = … }"),
    "model_type": ("a table is wanted here", "write it in braces: { name = … }"),
    "model_attributes_type": ("a table is wanted here", "write it in braces: { name = … }"),
}


def _fault(item: Any) -> DesignError:
    path = [str(part) for part in item["loc"] if part not in ("float", "str", "int")]
    where, name = ".".join(path), path[-1] if path else ""
    if item["type"] == "extra_forbidden":
        known = _keys_at(path[:-1])
        advice = "" if nearest(name, known) else "remove it, or put it under the table it belongs to"
        return DesignError("unknown key", where=where, found=repr(name), known=known, advice=advice)
    if item["type"] == "missing":
        return DesignError("missing required value", where=where, advice=f"give {name}")
    raw = item.get("input")
    if path[0] in ("parameters", "tolerance", "tuning") and isinstance(raw, dict):
        dotted = ".".join([name, *raw][:2])
        advice = f'a path is one name in quotes: write "{dotted}" = …'
        return DesignError("a value is wanted here", where=where, found=shown(raw), advice=advice)
    problem, advice = _WANTED.get(item["type"], (item["msg"][0].lower() + item["msg"][1:], ""))
    if item["type"] in ("list_type", "dict_type", "model_type") and path[0] == "effects" and len(path) == 1:
        advice = "begin every effect with [[effects]]"
    return DesignError(problem, where=where, found=shown(raw), advice=advice)


def _keys_at(path: list[str]) -> list[str]:
    model: Any = DesignTable
    for part in path:
        field = model.model_fields.get(part) if hasattr(model, "model_fields") else None
        if field is None:
            continue
        inner = [field.annotation, *getattr(field.annotation, "__args__", ())]
        models = [kind for kind in inner if isinstance(kind, type) and issubclass(kind, BaseModel)]
        model = models[0] if models else model
    return list(model.model_fields)
