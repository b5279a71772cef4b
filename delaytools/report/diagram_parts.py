"""What a block diagram shows of a design: boxes with their words, wires with their signs, effects at their ports."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

from delaytools.blocks.block import flat_values, specifications
from delaytools.blocks.equations import Equations
from delaytools.blocks.state_space import StateSpace
from delaytools.blocks.transfer_function import TransferFunction
from delaytools.design.build import build
from delaytools.design.design import Design
from delaytools.design.elements import make_element
from delaytools.design.parameters import Parameters
from delaytools.loop.loop import Element, Loop
from delaytools.loop.values import parameter_values, resolve
from delaytools.signals.expression import Expression

__all__ = ["Entry", "Mark", "Part", "diagram_parts"]

_SHORT = {
    "natural_frequency": "ωₙ",
    "damping": "ζ",
    "delay": "τ",
    "period": "T",
    "gain": "K",
    "time_constant": "T",
}
_SECONDS = ("s",)


@final
@dataclass(frozen=True)
class Entry:
    """A signal that enters a box: sign +1 or -1; port: its name where the box has several."""

    signal: str
    sign: int
    port: str


@final
@dataclass(frozen=True)
class Mark:
    """An effect at a port: words, and the side of the box ("input", "output", "inside")."""

    words: str
    side: str


@final
@dataclass(frozen=True)
class Part:
    """One block: name, kind, lines of values, what enters, what leaves, the effects at its ports."""

    name: str
    kind: str
    lines: tuple[str, ...]
    entries: tuple[Entry, ...]
    outputs: tuple[str, ...]
    bench: bool
    marks: tuple[Mark, ...]


def diagram_parts(design: Design) -> tuple[Part, ...]:
    """One part for each block of the design; values that configurations change are written as a range."""
    loop = build(design)
    loops = [build(design, name) for name in (None, *design.configurations)]
    removed = set(design.tables.flight.remove)
    found = []
    for name, table in design.data.get("blocks", {}).items():
        element = make_element(
            name, table, units=design.tables.signals, parameters=Parameters(loop.parameters)
        )
        words = _lines(element, [_numbers(item, name) for item in loops], loop.parameters)
        entries = _entries(element, loop)
        outputs = tuple(element.outputs.values())
        bench = name in removed
        found.append(Part(name, table["type"], words, entries, outputs, bench, _marks(design, loops, name)))
    return tuple(found)


def _numbers(loop: Loop, name: str) -> dict[str, float]:
    """The values of a block in one configuration, formulas of [parameters] worked out."""
    known = parameter_values(loop, {})
    return {
        key: float(raw.evaluate(known) if isinstance(raw, Expression) else raw)
        for key, raw in flat_values(loop[name].block).items()
    }


def _entries(element: Element, loop: Loop) -> tuple[Entry, ...]:
    numbers = parameter_values(loop, {})
    several = len(element.inputs) > 1
    found = []
    for port, expression in element.inputs.items():
        for name in expression.names:
            if name not in loop.parameters:
                found.append(Entry(name, _sign(expression, name, numbers), port if several else ""))
    return tuple(found)


def _sign(expression: Expression, name: str, numbers: Mapping[str, Any]) -> int:
    """The sign of the signal's factor in a linear combination."""
    signals = {n: 0.0 for n in expression.names if n not in numbers}
    factor = float(expression.evaluate({**numbers, **signals, name: 1.0}))
    return -1 if factor < 0 else 1


def _lines(
    element: Element, values: list[dict[str, float]], parameters: Mapping[str, Any]
) -> tuple[str, ...]:
    block = element.block
    if isinstance(block, TransferFunction):
        lines = [_ratio(element, values)]
    elif isinstance(block, Equations):
        lines = [_short(f"{state}' = {formula.text}") for state, formula in block.rates.items()]
    elif isinstance(block, StateSpace):
        lines = [f"{len(flat_values(block))} values"]
    else:
        lines = _values(element, values)
    text = next(iter(element.inputs.values())).text
    factors = set(next(iter(element.inputs.values())).names) & set(parameters)
    if len(element.inputs) == 1 and (factors or any(sign in text for sign in "0123456789*/")):
        lines = [*lines, *_wrapped(text.replace("*", "·").replace(" - ", " − "))]
    return tuple(lines)


def _values(element: Element, values: list[dict[str, float]]) -> list[str]:
    specs, lines = specifications(element.block), []
    for name in flat_values(element.block):
        spec = specs.get(name.split("[")[0])
        unit = spec.unit if spec is not None else ""
        numbers = sorted({item[name] for item in values})
        if numbers == [getattr(type(element.block), name, None)]:
            continue  # the default, everywhere
        scale, unit = (1e3, "ms") if unit in _SECONDS else (1.0, "" if unit.startswith("signal") else unit)
        written = [f"{number * scale:.4g}" for number in (numbers[0], numbers[-1])]
        text = written[0] if len(set(written)) == 1 else f"{written[0]} … {written[1]}"
        lines.append(f"{_SHORT.get(name, name)} = {text} {unit}".rstrip())
    return lines[:4]


def _ratio(element: Element, values: list[dict[str, float]]) -> str:
    block = element.block
    assert isinstance(block, TransferFunction)
    top, bottom = (
        _polynomial([values[0][f"{name}[{i}]"] for i in range(len(getattr(block, name)))])
        for name in ("numerator", "denominator")
    )
    top = top if " " not in top else f"({top})"
    bottom = bottom if " " not in bottom else f"({bottom})"
    return _short(f"{top} / {bottom}")


def _polynomial(factors: list[float]) -> str:
    powers = {0: "", 1: "s", 2: "s²", 3: "s³"}
    terms = []
    for place, factor in enumerate(factors):
        power = len(factors) - 1 - place
        letter = powers.get(power, f"s^{power}")
        if factor:
            number = "" if factor == 1 and letter else f"{factor:.4g}"
            terms.append(number + (" " if number and letter else "") + letter)
    return " + ".join(terms).replace("+ -", "− ") or "0"


def _short(text: str, most: int = 30) -> str:
    text = text.replace("*", "·")
    return text if len(text) <= most else text[: most - 1] + "…"


def _wrapped(text: str, width: int = 23) -> list[str]:
    lines = [""]
    for word in text.split(" "):
        if lines[-1] and len(lines[-1]) + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines if len(lines) <= 4 else [*lines[:3], lines[3][:22] + "…"]


def _marks(design: Design, loops: list[Loop], name: str) -> tuple[Mark, ...]:
    """The effects of all configurations at the block's ports, each once."""
    tables = [*design.tables.effects, *(e for c in design.tables.configurations.values() for e in c.effects)]
    found: dict[Mark, None] = {}
    for table in tables:
        block, _, port = table.at.partition(".")
        if block == name:
            side = port if port in ("input", "output") else _side(loops[0], name, port)
            found.setdefault(Mark(_effect_words(dict(table.model_dump())), side))
    return tuple(found)


def _side(loop: Loop, name: str, port: str) -> str:
    element = next((e for e in resolve(loop).elements if e.name == name), None)
    if element is not None and port in element.inputs:
        return "input"
    if element is not None and port in element.outputs:
        return "output"
    return "inside"


def _effect_words(table: dict[str, Any]) -> str:
    kind = str(table["type"]).replace("_", " ")
    values = [
        f"{v}" for k, v in table.items() if k not in ("type", "at") and isinstance(v, str | int | float)
    ]
    return _short(f"{kind} {values[0]}" if values else kind, 26)
