"""A diagnosis put into the design: certain effects as entries or changed values, with a comment on their origin."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

from delaytools.design.catalogue import PARAMETER_CHANGE
from delaytools.design.design import Design
from delaytools.design.edit import with_effect, with_value
from delaytools.diagnosis.answer import Diagnosis, Missing, Quantity, Step
from delaytools.signals.trouble import AnalysisError, DelaytoolsError
from delaytools.signals.units import convert, quantity, unit

__all__ = ["Addition", "additions", "improved", "written"]

SPARE = 6  # significant digits where no standard error is known
SHORT = 0.5  # s: shorter times are written in ms


@final
@dataclass(frozen=True)
class Addition:
    """One change of the design. place: "effects.N", or the path of a block's value; table: what is written there."""

    missing: Missing
    place: str
    table: Mapping[str, Any]
    comment: str


def improved(
    design: Design,
    diagnosis: Diagnosis,
    *,
    logs: Sequence[str],
    date: str,
    configuration: str | None = None,
    effect: str | None = None,
    values: bool = False,
) -> Design:
    """The design with what the diagnosis is certain to be missing; the base is changed, not the configuration.

    logs, date: named in the comments. effect: TYPE@PORT, this one alone, whether certain or not. values: tolerated
    values are set to what was fitted too. Raises AnalysisError for an effect that the diagnosis did not fit.
    """
    new = design
    for one in additions(design, diagnosis, logs=logs, date=date, configuration=configuration, effect=effect):
        if one.place.startswith("effects."):
            new = with_effect(new, one.table, comment=one.comment)
        else:
            new = with_value(new, one.place, one.table[one.place], comment=one.comment)
    for path, found in diagnosis.tolerated.items() if values else ():
        said = f"{_origin(logs, date)}: {_value_words(path, found)}, inside its tolerance"
        new = with_value(new, path, _as_before(design, path, found), comment=said)
    return new


def additions(
    design: Design,
    diagnosis: Diagnosis,
    *,
    logs: Sequence[str],
    date: str,
    configuration: str | None = None,
    effect: str | None = None,
) -> tuple[Addition, ...]:
    """What `improved` changes, in order."""
    chosen = (
        [one for one in diagnosis.missing if one.certain] if effect is None else [_named(diagnosis, effect)]
    )
    found, number = [], len(design.data.get("effects", []))
    for one in chosen:
        comment = _comment(one, diagnosis.ladder, _origin(logs, date), configuration)
        path = _plain_value(design, one, configuration)
        if path is not None:
            table = {path: _as_before(design, path, next(iter(one.parameters.values())))}
            found.append(Addition(one, path, table, comment))
            continue
        found.append(Addition(one, f"effects.{number}", _table(one), comment))
        number += 1
    return tuple(found)


def _named(diagnosis: Diagnosis, effect: str) -> Missing:
    """The effect of that name among what was diagnosed, else among its rivals."""
    kind, _, at = effect.partition("@")
    for one in diagnosis.missing:
        if (one.effect, one.at) == (kind, at):
            return one
    listed = [(s, r) for s, rivals in diagnosis.ranking.items() for r in rivals]
    listed += [(group.signal, r) for group in diagnosis.confusable for r in group.members]
    for signal, rival in listed:
        if (rival.effect, rival.at) == (kind, at):
            return Missing(kind, at, signal, rival.parameters, rival.settings, certain=False)
    known = dict.fromkeys(
        [f"{m.effect}@{m.at}" for m in diagnosis.missing] + [f"{r.effect}@{r.at}" for _, r in listed]
    )
    raise AnalysisError(
        "the diagnosis did not fit this effect", found=repr(effect), known=tuple(known),
        advice="choose one of these, or write it into the design by hand",
    )  # fmt: skip


def _plain_value(design: Design, one: Missing, configuration: str | None) -> str | None:
    """The path of the block's value that changes, where it is a number of the base that nothing overrides."""
    kind, _, name = one.effect.partition(":")
    if kind != PARAMETER_CHANGE:
        return None
    if any((e.get("type"), e.get("at")) == (one.effect, one.at) for e in design.data.get("effects", [])):
        return None
    path = f"{one.at}.{name}"
    chain, tables = configuration, design.tables.configurations
    while chain is not None:
        if path in tables[chain].set:
            return None
        chain = tables[chain].extend
    raw = _raw(design, path)
    plain = isinstance(raw, int | float) or (isinstance(raw, str) and quantity(raw) is not None)
    return path if plain or raw is None else None


def _raw(design: Design, path: str) -> Any:
    """What the file writes at BLOCK.VALUE or parameters.NAME; None where it leaves the value out."""
    first, _, name = path.partition(".")
    table: Any = design.data["parameters"] if first == "parameters" else design.data["blocks"].get(first, {})
    name, *places = name.replace("]", "").split("[")
    if first != "parameters" and table.get("type") == "equations":
        table = next((table[key] for key in ("parameters", "states") if name in table.get(key, {})), table)
    found = table.get(name)
    for place in places:
        found = found[int(place)] if isinstance(found, list) else None
    return found


def _as_before(design: Design, path: str, found: Quantity) -> Any:
    """The fitted value in the unit in which the file writes it now."""
    raw = _raw(design, path)
    parts = quantity(raw) if isinstance(raw, str) else None
    if parts is None or not parts[1]:
        return (
            rounded(found.value, found.std) if isinstance(raw, int | float) or raw is None else written(found)
        )
    scale = convert(1.0, parts[1], found.unit) if found.unit else unit(parts[1]).scale
    return f"{_text(rounded(found.value / scale, found.std / scale))} {parts[1]}"


def rounded(value: float, std: float) -> float:
    """The value to the second significant digit of its standard error."""
    if not math.isfinite(value) or value == 0:
        return value
    if not (math.isfinite(std) and std > 0):
        return float(f"{value:.{SPARE}g}")
    return round(value, 1 - math.floor(math.log10(std))) if std < abs(value) else float(f"{value:.2g}")


def _text(value: float) -> str:
    return f"{value:.12g}"


def written(found: Quantity) -> Any:
    """A fitted value as a design file writes it: "0.3 deg", "15 ms", or a bare number."""
    value, std, symbol = found.value, found.std, found.unit
    if symbol == "s" and abs(value) < SHORT:
        value, std, symbol = value * 1e3, std * 1e3, "ms"
    if not symbol or symbol == "1" or not _is_unit(symbol):
        return rounded(value, std)
    return f"{_text(rounded(value, std))} {symbol}"


def _is_unit(symbol: str) -> bool:
    try:
        unit(symbol)
    except DelaytoolsError:
        return False
    return True


def _table(one: Missing) -> dict[str, Any]:
    values = {name: written(item) for name, item in one.parameters.items()}
    return {"type": one.effect, "at": one.at, **values, **one.settings}


def _origin(logs: Sequence[str], date: str) -> str:
    return f"fitted to {', '.join(logs)} on {date}"


def _value_words(name: str, item: Quantity) -> str:
    symbol = f" {item.unit}" if item.unit else ""
    spread = f" ± {item.std:.2g}" if math.isfinite(item.std) else ""
    return f"{name} {_text(rounded(item.value, item.std))}{spread}{symbol}"


def _comment(one: Missing, ladder: Sequence[Step], origin: str, configuration: str | None) -> str:
    """Where it comes from: logs, date, standard errors, and the held-out error without and with it."""
    lines = [f"{origin}: {', '.join(_value_words(name, item) for name, item in one.parameters.items())}"]
    places = [k for k, step in enumerate(ladder) if step.step == f"+ {one.effect}@{one.at}"]
    if places and places[0] > 0:
        before, after = (ladder[places[0] - back].errors.get(one.signal, math.nan) for back in (1, 0))
        if math.isfinite(before) and math.isfinite(after):
            lines.append(f"held-out error of {one.signal}: {before:.3g} rms without it, {after:.3g} with it")
    if not one.certain:
        lines.append("not certain: these logs fit other effects as well")
    if configuration is not None:
        lines.append(
            f"fitted in the configuration {configuration}; it stands in the base, so every one has it"
        )
    return "\n".join(lines)
