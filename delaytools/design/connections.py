"""Whether the names of a loop fit together: one writer each, linear inputs, no name with two meanings or misspelt."""

import re
from collections.abc import Mapping
from difflib import SequenceMatcher
from typing import Any

import casadi as ca
import numpy as np

from delaytools.blocks.block import CASADI
from delaytools.design.faults import Faults
from delaytools.loop.loop import Element, Loop
from delaytools.loop.values import parameter_values
from delaytools.signals.trouble import DesignError, shown

__all__ = ["check_connections"]


def check_connections(loop: Loop, data: Mapping[str, Any], faults: Faults, *, whole: bool) -> None:
    """What is wrong with the wiring goes to `faults`; `whole`: no block was left out because of its own faults."""
    declared = {*data.get("signals", {}), *data.get("inputs", {})}
    clash = sorted(set(loop.parameters) & {*loop.writers, *declared})
    for name in clash:
        with faults.at(f"parameters.{name}"):
            raise DesignError(
                "one name for a signal and a parameter", found=repr(name), advice="rename one of them"
            )
    _one_writer(loop, faults)
    if clash:
        return
    for element in loop.elements:
        for port in element.inputs:
            with faults.at(f"blocks.{element.name}.{port}"):
                _check_linear(loop, element, port, declared)
                if whole:
                    _check_spelling(loop, element, port, data)


def _one_writer(loop: Loop, faults: Faults) -> None:
    seen: dict[str, str] = {}
    for element in loop.elements:
        for signal in element.outputs.values():
            if signal in seen:
                with faults.at(f"signal {signal}"):
                    raise DesignError(
                        "two writers of one signal",
                        found=f"blocks {seen[signal]} and {element.name}",
                        advice="give each block an output signal of its own",
                    )
            seen[signal] = element.name


def _check_linear(loop: Loop, element: Element, port: str, declared: set[str]) -> None:
    formula = element.inputs[port]
    symbols = {name: ca.SX.sym(name) for name in formula.names if name not in loop.parameters}
    if not symbols:
        raise DesignError("an input reads no signal", found=shown(formula.text), advice="name a signal")
    column = ca.vertcat(*symbols.values())
    value = ca.SX(formula.evaluate({**parameter_values(loop, {}), **symbols}, CASADI))
    if not ca.is_linear(value, column):
        _say_unknown_factor(loop, symbols, declared)
        raise DesignError(
            "an input is a signal or a linear combination of signals",
            found=shown(formula.text),
            advice="put the formula into an equations block",
        )
    parts = ca.Function("parts", [column], [ca.jacobian(value, column), value])
    if not all(np.isfinite(np.asarray(part)).all() for part in parts(np.ones(len(symbols)))):
        raise DesignError("a factor without a finite value", found=shown(formula.text))


def _say_unknown_factor(loop: Loop, names: Mapping[str, Any], declared: set[str]) -> None:
    strange = [name for name in names if name not in loop.writers and name not in declared]
    if strange and loop.parameters:
        raise DesignError(
            "a factor that is no parameter",
            found=repr(strange[0]),
            known=sorted(loop.parameters),
            advice="give it under [parameters]",
        )


def _check_spelling(loop: Loop, element: Element, port: str, data: Mapping[str, Any]) -> None:
    """A signal that is neither written nor declared, and nearly has the name of one that is, is a misspelling."""
    signals = data.get("signals", {})
    if not signals:
        return
    known = list(dict.fromkeys([*signals, *loop.writers, *data.get("inputs", {})]))
    for name in element.inputs[port].names:
        if name in loop.parameters or name in known:
            continue
        if any(_misspelt(name, other) for other in (*known, *loop.parameters)):
            raise DesignError(
                "unknown signal",
                found=repr(name),
                known=sorted([*known, *loop.parameters]),
                advice="if it is an external input, declare it under [signals]",
            )


def _misspelt(name: str, other: str) -> bool:
    """Whether one name looks like the other with a slip: not where only digits, an ending or short words differ."""
    plain, meant = (re.sub(r"\d", "", text).lower() for text in (name, other))
    if plain == meant or plain.startswith(meant) or meant.startswith(plain):
        return name.lower() == other.lower()
    words, others = plain.split("_"), meant.split("_")
    differing = [pair for pair in zip(words, others, strict=False) if pair[0] != pair[1]]
    if len(words) == len(others) and any(min(len(a), len(b)) < 3 for a, b in differing):
        return False
    swapped = sorted(plain) == sorted(meant)
    return swapped or SequenceMatcher(None, plain, meant).ratio() >= 0.8
