"""The command margins: of the loop opened at one signal, at several, against a delay, and what else a loop bears."""

from typing import Annotated, Any

import typer

from delaytools.cli.answers import check_targets, write_json
from delaytools.cli.options import At, Configuration, DelayAt, DelayRange, DesignPath, Hold, Json, say
from delaytools.cli.reading import delay_range, opened_loop

__all__ = ["margins"]

Together = Annotated[
    str | None,
    typer.Option("--together", metavar="SIGNAL,SIGNAL", help="Signals opened at once, for their disk margin."),
]
Each = Annotated[
    str | None,
    typer.Option("--each", metavar="SIGNAL,SIGNAL", help="Signals opened one at a time, all others closed."),
]
Rate = Annotated[
    float | None,
    typer.Option("--delay-rate", metavar="RATE", min=0.0, help="Of a delay that varies: most s per s, for jitter."),
]
Runs = Annotated[
    bool, typer.Option("--jitter-runs", help="Bracket the jitter margin from above, by runs of the linear loop.")
]
Gate = Annotated[bool, typer.Option("--gate", help="Exit 1 where the loop is unstable at any delay asked.")]


def margins(
    design: DesignPath,
    at: At = None,
    delay: DelayRange = None,
    delay_at: DelayAt = None,
    configuration: Configuration = None,
    json: Json = None,
    together: Together = None,
    each: Each = None,
    rate: Rate = None,
    runs: Runs = False,
    hold: Hold = None,
    gate: Gate = False,
) -> None:
    """Exact margins of the loop opened at a signal, against an extra delay."""
    from delaytools.analysis.disk_margins import loop_disk_margin
    from delaytools.analysis.questions import loop_allowances, loop_margins
    from delaytools.cli.words import (
        allowance_lines,
        disk_lines,
        each_lines,
        jitter_lines,
        margin_lines,
        rest_lines,
    )
    from delaytools.loop.trim import trim

    check_targets(json)
    loop, at, delay_at = opened_loop(design, configuration, at, delay_at, hold)
    delays = delay_range(delay) or [0.0]
    answer = loop_margins(loop, at, delays, delay_at=delay_at)
    varying = {} if rate is None else {"rate": rate}
    more = loop_allowances(loop, at, delays[0], delay_at=delay_at, **varying) if len(delays) == 1 else None
    lost = _lost(loop, at, delays[0], delay_at, varying) if runs else None
    disk = loop_disk_margin(loop, _names(together)) if together is not None else None
    alone = {name: loop_margins(loop, name, delays[:1], delay_at=delay_at).margins[0] for name in _names(each)}
    rest = trim(loop)
    if json != "-":
        bears = [*allowance_lines(more, at, delay_at), *jitter_lines(lost), *disk_lines(disk), *each_lines(alone)]
        say("\n".join([*margin_lines(answer), *bears, *rest_lines(rest, loop.units)]))
    if json is not None:
        asked = {"jitter_runs": lost, "each": alone, "operating_point": dict(rest.signals) if rest.is_off_zero else {}}
        write_json(margins_answer(answer, more, disk) | {k: found for k, found in asked.items() if found}, json)
    if gate and not all(m.stable for m in answer.margins):
        raise typer.Exit(1)


def _lost(loop: Any, at: str, extra: float, delay_at: str | None, varying: dict[str, float]) -> Any:
    from delaytools.analysis.jitter_runs import jitter_runs

    return jitter_runs(loop, at, extra, delay_at=delay_at, **varying)


def _names(text: str | None) -> list[str]:
    """Signals of a list with commas."""
    return [] if text is None else [name.strip() for name in text.split(",")]


def margins_answer(answer: Any, more: Any = None, disk: Any = None) -> dict[str, Any]:
    """The answer of `margins` as the contract names it; more: allowances, disk: of several signals, where asked."""
    listed = []
    for item in answer.margins:
        entry = {name: getattr(item, name) for name in item.__dataclass_fields__ if name != "why"}
        for name, why in item.why.items():
            entry[f"{name}_why"] = why
        entry["why"] = "closed loop unstable" if not item.stable else ("never" if item.why else "")
        listed.append(entry)
    found: dict[str, Any] = {
        "margins": listed,
        "stable_delays": [list(pair) for pair in answer.stable_delays],
    }
    if more is not None:
        found["stable_gains"] = [list(pair) for pair in more.gains.stable]
        found["gains_looked_at"] = list(more.gains.looked_at)
        found["jitter_margin"] = more.jitter.margin if more.jitter is not None else None
        found["jitter_margin_why"] = "" if more.jitter is not None else "closed loop unstable"
        found["jitter_sampling"] = more.jitter_sampling
        found["approximation"] = more.approximate
    if disk is not None:
        found["simultaneous_disk_margin"] = disk
    names = ("at", "delay_at", "why_approximate", "small_delays")
    return found | {name: getattr(answer, name) for name in names}
