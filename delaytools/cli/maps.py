"""The command stability-map: where a loop is stable in the plane of a delay and one thing more."""

import math
from typing import Annotated, Any

import typer

from delaytools.cli.answers import check_targets, write_json
from delaytools.cli.options import At, Configuration, DelayAt, DesignPath, Hold, Json, say
from delaytools.cli.reading import delay_range, gain_range, opened_loop
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["stability_map"]

Span = tuple[float, float]


def stability_map(
    design: DesignPath,
    delay: Annotated[str, typer.Option("--delay", metavar="FROM:TO", help="Extra delays along x, e.g. 0:50ms.")],
    gain: Annotated[
        str | None, typer.Option("--gain", metavar="FROM:TO", help="Along y: factors on the opened signal.")
    ] = None,
    second_delay: Annotated[
        str | None, typer.Option("--second-delay", metavar="PORT=FROM:TO", help="Along y: another extra delay.")
    ] = None,
    number: Annotated[
        str | None,
        typer.Option("--number", metavar="PATH=FROM:TO", help="Along y: a value of the design, in SI units."),
    ] = None,
    time: Annotated[
        str | None, typer.Option("--time", metavar="FROM:TO", help="Along y: moments of the run, e.g. 0:20s.")
    ] = None,
    at: At = None,
    delay_at: DelayAt = None,
    configuration: Configuration = None,
    hold: Hold = None,
    out: Annotated[str | None, typer.Option("--out", metavar="FILE", help="Draw it: .png, .svg or .pdf.")] = None,
    json: Json = None,
) -> None:
    """Where the loop is stable over an extra delay and a gain, a second delay, a number of the design, or time."""
    from delaytools.analysis.loop_map import TIME, loop_map

    check_targets(json)
    loop, at, delay_at = opened_loop(design, configuration, at, delay_at, hold)
    port, path = _named(second_delay, "--second-delay"), _named(number, "--number")
    along = None if path is None else (path[0], _span(gain_range(_with_count(path[1])), "--number"))
    if time is not None:
        if along is not None:
            raise DelaytoolsError("a map has one second parameter", where="--time", advice="give --number or --time")
        along = TIME, _times(time, "--time")
    found = loop_map(
        loop, at, _times(delay, "--delay"), delay_at=delay_at,
        gains=None if gain is None else _span(gain_range(_with_count(gain)), "--gain"),
        second=None if port is None else (port[0], _times(port[1], "--second-delay")),
        number=along,
    )  # fmt: skip
    named = f"factor on {at}" if gain is not None else f"delay at {port[0]}" if port else along[0] if along else ""
    if out is not None:
        _draw(found, delay_at or at, named, out)
    if json != "-":
        say("\n".join(map_lines(found, delay_at or at, named)))
    if json is not None:
        write_json(map_table(found), json)


def map_lines(found: Any, place: str, named: str) -> list[str]:
    """How much of the plane is stable, and where each curve runs."""
    lines = [
        f"delay at {place} {_shown(found, 0, found.spans[0][0])} to {_shown(found, 0, found.spans[0][1])}, "
        f"{named} {_shown(found, 1, found.spans[1][0])} to {_shown(found, 1, found.spans[1][1])}; "
        f"sampling: {found.sampling}",
        f"stable in {100 * found.stable_share:.1f} % of the plane; {len(found.curves)} curves on which roots cross",
    ]
    for one in found.curves:
        hertz = sorted(float(w) / (2 * math.pi) for w in (one.frequency[0], one.frequency[-1]))
        lines.append(
            f"  from ({_shown(found, 0, one.x[0])}, {_shown(found, 1, one.y[0])}) to "
            f"({_shown(found, 0, one.x[-1])}, {_shown(found, 1, one.y[-1])}): {hertz[0]:.4g} to {hertz[1]:.4g} Hz"
        )
    return lines


def map_table(found: Any) -> dict[str, Any]:
    """Everything, in SI; counts of a chain without end are null."""
    return {
        "names": found.names, "spans": found.spans, "sampling": found.sampling,
        "linearised_without": found.linearised_without, "stable_share": found.stable_share,
        "curves": [
            {name: getattr(one, name).tolist() for name in ("x", "y", "frequency", "towards")} for one in found.curves
        ],
        "grid_x": found.grid_x.tolist(), "grid_y": found.grid_y.tolist(),
        "counts": [[int(n) if math.isfinite(n) else None for n in row] for row in found.counts.tolist()],
    }  # fmt: skip


def _draw(found: Any, place: str, named: str, out: str) -> None:
    from delaytools.report.figure_map import AxisWords, draw_map
    from delaytools.report.write import write_figure

    second = found.names[1] == "delay"
    y = AxisWords(f"D{named[1:]} (ms)", 1e3) if second else AxisWords(named[:1].upper() + named[1:])
    message = f"Stable in {100 * found.stable_share:.0f} % of the plane; sampling: {found.sampling}"
    stands = {"delay": (0.0, 0.0), "gain": (0.0, 1.0)}.get(found.names[1])
    inside = stands is not None and all(a <= v <= b for v, (a, b) in zip(stands, found.spans, strict=True))
    y = AxisWords("Time (s)") if named == "time" else y
    x = AxisWords(f"Delay at {place} (ms)", 1e3)
    write_figure(draw_map(found, x, y, message, stands if inside else None), out)


def _shown(found: Any, axis: int, value: float) -> str:
    return f"{value * 1e3:.5g} ms" if found.names[axis] == "delay" else f"{value:.5g}"


def _with_count(text: str) -> str:
    """FROM:TO as a range of two values; what else is there is left to be refused."""
    return f"{text}:2" if text.count(":") == 1 else text


def _times(text: str, option: str) -> Span:
    return _span(delay_range(_with_count(text), option), option)


def _span(values: list[float] | None, option: str) -> Span:
    if values is None or len(values) < 2:
        raise DelaytoolsError("a range is FROM:TO", where=option, advice="write 0:50ms or 0.5:2")
    return values[0], values[-1]


def _named(text: str | None, option: str) -> tuple[str, str] | None:
    if text is None:
        return None
    name, sign, span = text.partition("=")
    if not sign:
        raise DelaytoolsError("a name and a range", where=option, found=repr(text), advice="write NAME=FROM:TO")
    return name.strip(), span.strip()
