"""The command limit-cycle: oscillations that nonlinear pieces sustain."""

import math
from typing import Annotated, Any

import typer

from delaytools.cli.answers import check_targets, write_json
from delaytools.cli.options import (
    At,
    Configuration,
    DelayAt,
    DelayRange,
    DesignPath,
    Hold,
    Json,
    progress,
    say,
)
from delaytools.cli.reading import delay_range, opened_loop
from delaytools.cli.words import number_cell, table_lines

__all__ = ["limit_cycle"]


def limit_cycle(
    design: DesignPath,
    at: At = None,
    delay: DelayRange = None,
    delay_at: DelayAt = None,
    configuration: Configuration = None,
    check: Annotated[bool, typer.Option(help="Run the loop from below and above each predicted cycle.")] = True,
    hold: Hold = None,
    json: Json = None,
) -> None:
    """Limit cycles by describing functions with exact delay, each checked by simulation; against an extra delay."""
    from delaytools.analysis.limit_cycles import limit_cycles

    check_targets(json)
    loop, at, delay_at = opened_loop(design, configuration, at, delay_at, hold)
    answer = limit_cycles(
        loop, at, delay_range(delay), delay_at=delay_at, check=check, progress=progress()
    )
    if json != "-":
        say("\n".join(cycle_lines(answer, loop.units.get(at, ""))))
    if json is not None:
        names = ("at", "delay_at", "nonlinear", "sampling", "linearised_without", "why")
        write_json({"limit_cycles": answer.cycles} | {name: getattr(answer, name) for name in names}, json)


def cycle_lines(answer: Any, unit: str) -> list[str]:
    """The cycles as a table, then what each nonlinear piece does in those that last."""
    lines = [f"limit cycles, amplitude at {answer.at}; extra delay at {answer.delay_at}; sampling: {answer.sampling}"]
    if answer.linearised_without:
        lines.append("linearised without " + ", ".join(answer.linearised_without))
    lines.append("nonlinear: " + (", ".join(answer.nonlinear) or "nothing"))
    if answer.why:
        return [*lines, f"none: {answer.why}"]
    heads = ["delay ms", f"amplitude {unit}".strip(), "Hz", "lasts", "harmonics %", "simulated", "at Hz", "simulation"]
    rows = []
    for one in answer.cycles:
        seen = one.check
        simulated = (seen.amplitude, seen.frequency) if seen is not None else (math.nan, math.nan)
        words = "not run" if seen is None else ("agrees: " if seen.agrees else "DISAGREES: ") + seen.words
        rows.append([
            number_cell(one.delay, 1e3), number_cell(one.amplitude), number_cell(one.frequency),
            "yes" if one.stable else "no", number_cell(one.distortion, 100, "{:.1f}"),
            *map(number_cell, simulated), words,
        ])  # fmt: skip
    width = max(len(row[-1]) for row in rows)  # words stand to the left, numbers to the right
    rows = [[*row[:-1], row[-1].ljust(width)] for row in rows]
    heads[-1] = heads[-1].ljust(width)
    table = [line.rstrip() for line in table_lines(heads, rows)]
    return [*lines, *table, *(line for one in answer.cycles if one.stable for line in _pieces(one))]


def _pieces(one: Any) -> list[str]:
    """What each piece does in a cycle that lasts, and the exact cycle where one is known."""
    lines = [f"in the cycle of {one.frequency:.4g} Hz at {one.delay * 1e3:.4g} ms:"]
    for piece in one.pieces:
        words = [f"  {piece.name}: {piece.amplitude:.4g} enters"]
        if math.isfinite(piece.gain):
            words.append(f"gain {piece.gain:.3g}, phase {math.degrees(piece.phase):.1f} deg")
        if piece.drives is not None:
            words.append("drives it" if piece.drives else "holds it down")
        lines.append(", ".join(words))
    if one.exact is not None:
        lines.append(f"  exactly (Tsypkin): {one.exact.frequency:.6g} Hz, {one.exact.amplitude:.6g} enters at most")
    return lines
