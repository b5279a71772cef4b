"""What the commands share: options as numbers, the design, its configuration, logs."""

import math
from collections.abc import Sequence
from typing import Any

from delaytools.cli.options import warn
from delaytools.signals.trouble import DelaytoolsError
from delaytools.signals.units import convert, quantity

__all__ = [
    "check_delay_port", "delay_range", "gain_range", "held", "load", "log_columns", "opened_at", "opened_loop",
    "seconds",
]  # fmt: skip


def seconds(text: str, option: str) -> float:
    """A time such as "15ms", "15 ms" or "0.015" in s."""
    parts = quantity(text)
    if parts is None:
        raise DelaytoolsError("not a time", where=option, found=repr(text), advice="write 15ms or 0.015")
    number, unit = parts
    if not math.isfinite(number):
        raise DelaytoolsError(
            "not a finite time", where=option, found=repr(text), advice="write 15ms or 0.015"
        )
    try:
        return convert(number, unit or "s", "s")
    except DelaytoolsError as error:
        raise error.at(option) from error


def delay_range(text: str | None, option: str = "--delay") -> list[float] | None:
    """Times in s of "15ms" or of FROM:TO:COUNT such as "0:50ms:200"."""
    if text is None:
        return None
    return _range(text, option, lambda part: seconds(part, option))


def gain_range(text: str | None) -> list[float] | None:
    """Factors of "2.5" or of FROM:TO:COUNT."""
    if text is None:
        return None
    return _range(text, "--gain", lambda part: _number(part, "--gain"))


def _number(text: str, option: str) -> float:
    try:
        found = float(text)
    except ValueError as error:
        raise DelaytoolsError(
            "not a number", where=option, found=repr(text), advice="write 0.5:2:100"
        ) from error
    if not math.isfinite(found):
        raise DelaytoolsError("not a finite number", where=option, found=repr(text), advice="write 0.5:2:100")
    return found


def _range(text: str, option: str, read: Any) -> list[float]:
    parts = text.split(":")
    if len(parts) == 1:
        return [read(parts[0])]
    if len(parts) != 3 or not parts[2].isdigit() or int(parts[2]) < 1:
        raise DelaytoolsError(
            "a range is FROM:TO:COUNT", where=option, found=repr(text), advice="write 0:50ms:200"
        )
    low, high, count = read(parts[0]), read(parts[1]), int(parts[2])
    if high < low:
        raise DelaytoolsError("a range runs upwards", where=option, found=repr(text))
    step = (high - low) / max(1, count - 1)
    return [low + step * k for k in range(count)]


def load(path: str, configuration: str | None = None) -> tuple[Any, Any, tuple[str, ...]]:
    """(design, loop, warnings) of a design file."""
    from delaytools.design.build import build, check_paths, warnings
    from delaytools.design.file import read_design

    design = read_design(path)
    loop = build(design, configuration)
    check_paths(design, loop)
    return design, loop, warnings(design, loop)


def log_columns(design: Any, loop: Any) -> Any:
    """How the design maps a log's columns to its signals."""
    from delaytools.loop.network import network
    from delaytools.loop.values import resolve
    from delaytools.measurement.log_file import Columns

    table = design.tables.log
    held = network(resolve(loop)).held_signals
    return Columns(table.time or "time", dict(table.columns), dict(loop.units), held)


def check_delay_port(design: Any, loop: Any, text: str) -> None:
    """Raises DelaytoolsError where --delay-at names no input or output of a block."""
    from delaytools.loop.port import find_port

    try:
        port = find_port(loop, text)
    except DelaytoolsError as error:
        raise error.at(f"{design.name}: --delay-at") from error
    if port.kind not in ("input", "output"):
        raise DelaytoolsError(
            "an extra delay acts at an input or output",
            where=f"{design.name}: --delay-at",
            found=repr(text),
            advice=f"write {port.element}.input",
        )


def opened_loop(
    design: str, configuration: str | None, at: str | None, delay_at: str | None, hold: Sequence[str] | None = None
) -> tuple[Any, str, str | None]:
    """The loop of a design file, where it is opened and where an extra delay stands; says what is odd in the file.

    hold: external inputs held at values, as `held` reads them.
    """
    from delaytools.loop.edit import held_at

    plan, loop, odd = load(design, configuration)
    warn(odd)
    return held_at(loop, held(loop, hold or ())), *opened_at(plan, loop, at, delay_at)


def held(loop: Any, texts: Sequence[str]) -> dict[str, float]:
    """External inputs and their values in their units, of texts such as "roll_demand=5 deg"."""
    found = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        parts = quantity(value)
        if not sign or parts is None or not math.isfinite(parts[0]):
            raise DelaytoolsError("not an input and its value", where="--hold", found=repr(text), advice="write NAME=2")
        if name not in loop.externals:
            raise DelaytoolsError("not an external input", where="--hold", found=repr(name), known=loop.externals)
        number, unit = parts
        try:
            found[name] = convert(number, unit, loop.units.get(name, "")) if unit else number
        except DelaytoolsError as error:
            raise error.at(f"--hold {name}") from error
    return found


def opened_at(design: Any, loop: Any, at: str | None, delay_at: str | None) -> tuple[str, str | None]:
    """Where the loop is opened and where the extra delay stands: as asked for, else as [analysis] says."""
    known = [name for name in loop.signals if name in loop.writers]
    asked, at = at, at or design.tables.analysis.at
    if at is None:
        raise DelaytoolsError(
            "at which signal is the loop opened?",
            known=known,
            advice="give --at SIGNAL, or [analysis] at in the design",
        )
    if asked is not None and asked not in loop.writers:
        raise DelaytoolsError(
            "the loop can be opened where a block writes a signal",
            where=f"{design.name}: --at",
            found=repr(asked),
            known=known,
        )
    if delay_at is not None:
        check_delay_port(design, loop, delay_at)
    return at, delay_at or design.tables.analysis.delay_at
