"""The commands that hold a design against logs: compare, diagnose, improve."""

from datetime import date
from pathlib import Path
from typing import Annotated, Any

import typer

from delaytools.cli.answers import check_targets, write_json
from delaytools.cli.options import Budget, Configuration, DesignPath, Gate, Json, Logs, say, share_bar, warn
from delaytools.cli.reading import load, log_columns

__all__ = ["compare", "diagnose", "evidence", "improve"]

Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of everything that is drawn.")]
BUDGET = 170.0  # s


def compare(
    design: DesignPath, logs: Logs, configuration: Configuration = None, json: Json = None, gate: Gate = False
) -> None:
    """Model against measurement, signal by signal: how much, where in time, frequency and amplitude."""
    from delaytools.cli.measured_words import comparison_lines
    from delaytools.measurement.compare import compare as compare_records

    check_targets(json)
    plan, loop, odd = load(design, configuration)
    warn(odd)
    records, notes = read_records(plan, loop, logs)
    warn(notes)
    answer = compare_records(plan, records, configuration=configuration)
    if json != "-":
        say("\n".join(comparison_lines(answer)))
    if json is not None:
        write_json(comparison_answer(answer), json)
    if gate and not answer.adequate:
        raise typer.Exit(1)


def diagnose(
    design: DesignPath,
    logs: Logs,
    configuration: Configuration = None,
    seed: Seed = 1,
    budget: Budget = None,
    json: Json = None,
    gate: Gate = False,
) -> None:
    """Which physical effect is missing: named, placed, fitted, with its rivals and the error on held-out data."""
    from delaytools.cli.measured_words import diagnosis_lines

    check_targets(json)
    plan, loop, odd = load(design, configuration)
    warn(odd)
    records, notes = read_records(plan, loop, logs)
    warn(notes)
    answer = diagnosed(plan, records, configuration, seed, budget)
    if json != "-":
        say("\n".join(diagnosis_lines(answer)))
    if json is not None:
        write_json(_fields(answer), json)
    if answer.interrupted:
        raise typer.Exit(130)
    if gate and answer.verdict != "adequate":
        raise typer.Exit(1)


def improve(
    design: DesignPath,
    logs: Logs,
    effect: Annotated[
        str | None, typer.Option("--effect", metavar="TYPE@PORT", help="Add this one, certain or not.")
    ] = None,
    out: Annotated[str | None, typer.Option("--out", metavar="FILE", help="Write the improved design.")] = None,
    values: Annotated[bool, typer.Option("--values", help="Set values inside their tolerance too.")] = False,
    configuration: Configuration = None,
    seed: Seed = 1,
    budget: Budget = None,
    json: Json = None,
) -> None:
    """Add the diagnosed (or the named) effect to the design, fitted, with a comment on where it comes from."""
    from delaytools.cli.measured_words import ladder_lines
    from delaytools.design.build import build
    from delaytools.design.file import write_design
    from delaytools.diagnosis.improve import additions, improved

    check_targets(json, out)
    plan, loop, odd = load(design, configuration)
    warn(odd)
    records, notes = read_records(plan, loop, logs)
    warn(notes)
    answer = diagnosed(plan, records, configuration, seed, budget)
    origin: dict[str, Any] = {"logs": [Path(log).name for log in logs], "date": date.today().isoformat()}
    origin |= {"configuration": configuration, "effect": None if answer.interrupted else effect}
    added = additions(plan, answer, **origin)
    new = improved(plan, answer, **origin, values=values)
    build(new, configuration)
    out = None if answer.interrupted else out  # what is not finished is no design
    if out is not None:
        write_design(new, out)
    if json != "-":
        say("\n".join([*_added_lines(added, out), *ladder_lines(answer)]))
    if json is not None:
        write_json(_improve_answer(answer, added) | {"tolerated": answer.tolerated if values else {}, "out": out}, json)
    if answer.interrupted:
        raise typer.Exit(130)


def _improve_answer(answer: Any, added: Any) -> dict[str, Any]:
    listed = [_fields(one.missing) | {"place": one.place, "written": one.table} for one in added]
    names = ("ladder", "verdict", "notes", "interrupted")
    return {"added": listed} | {name: getattr(answer, name) for name in names}


def _added_lines(added: Any, out: str | None) -> list[str]:
    if not added:
        return ["nothing is added: no missing effect is certain (--effect TYPE@PORT adds one all the same)"]
    lines = []
    for one in added:
        lines += [f"# {line}" for line in one.comment.splitlines()]
        lines += ["[[effects]]"] if one.place.startswith("effects.") else []
        lines += [f"{name} = {value!r}".replace("'", '"') for name, value in one.table.items()]
    return [*lines, f"written to {out}" if out else "give --out FILE to write the design with this"]


def diagnosed(plan: Any, records: Any, configuration: str | None, seed: int, budget: float | None) -> Any:
    """The diagnosis, with a bar on a terminal; what is finished where it was interrupted."""
    from delaytools.diagnosis.answer import Interrupted
    from delaytools.diagnosis.diagnose import Effort
    from delaytools.diagnosis.diagnose import diagnose as diagnose_records

    effort = Effort(budget=budget or BUDGET, seed=seed)
    try:
        with share_bar("diagnosis") as tell:
            return diagnose_records(plan, records, configuration=configuration, progress=tell, effort=effort)
    except Interrupted as interrupt:
        return interrupt.answer


def evidence(
    plan: Any, loop: Any, logs: list[str], configuration: str | None, *, search: bool, budget: float | None
) -> Any:
    """What the logs say of the design, for the report."""
    from delaytools.measurement.compare import compare as compare_records
    from delaytools.report.evidence import Evidence

    records, notes = read_records(plan, loop, logs)
    warn(notes)
    comparison = compare_records(plan, records, configuration=configuration)
    answer = diagnosed(plan, records, configuration, 1, budget) if search else None
    if answer is not None and answer.interrupted:
        raise KeyboardInterrupt
    return Evidence(tuple(Path(log).name for log in logs), comparison, answer, configuration)


def read_records(plan: Any, loop: Any, logs: list[str]) -> tuple[Any, tuple[str, ...]]:
    """The logs as the design names their columns, and what is odd about them."""
    from delaytools.measurement.log_file import read_logs
    from delaytools.measurement.log_notes import log_notes

    records = read_logs(logs, log_columns(plan, loop))
    return records, tuple(note for record in records for note in log_notes(record))


def _fields(record: Any) -> dict[str, Any]:
    return {name: getattr(record, name) for name in record.__dataclass_fields__}


def comparison_answer(answer: Any) -> dict[str, Any]:
    """The answer of `compare` as the contract names it."""
    listed = [_signal_answer(one) for one in answer.signals]
    rest = {name: getattr(answer, name) for name in ("closed_loop", "not_compared", "notes")}
    return {"signals": listed, "where": answer.where, "adequate": answer.adequate} | rest


def _signal_answer(one: Any) -> dict[str, Any]:
    skipped = ("overall", "logs", "strips", "traces")
    found = {name: value for name, value in _fields(one).items() if name not in skipped}
    return found | _figures_answer(one.overall) | {"logs": [_figures_answer(log) for log in one.logs]}


def _figures_answer(item: Any) -> dict[str, Any]:
    found = {name: value for name, value in _fields(item).items() if name != "why"}
    return found | {f"{name}_why": why for name, why in item.why.items()}
