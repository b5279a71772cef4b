"""The command line: each command reads, calls one function of the Python API, and writes."""

import sys
from typing import Annotated, Any

import typer

from delaytools.cli.answers import write_json
from delaytools.cli.reading import delay_range, gain_range, load, log_columns, seconds
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["app", "run"]

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Delay in hardware-in-the-loop benches: exact margins, roots, runs, tuning, reports.",
)

DesignPath = Annotated[str, typer.Argument(metavar="DESIGN", help="Design file (TOML).")]
Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write the answer as JSON; - is standard output.")
]
Configuration = Annotated[
    str | None, typer.Option("--configuration", metavar="NAME", help="A named variant of the design.")
]
At = Annotated[str | None, typer.Option("--at", metavar="SIGNAL", help="Signal at which the loop is opened.")]
DelayAt = Annotated[str | None, typer.Option("--delay-at", metavar="PORT", help="Port of the extra delay.")]
DelayRange = Annotated[
    str | None, typer.Option("--delay", metavar="FROM:TO:COUNT", help="Extra delays, e.g. 0:50ms:200.")
]


def _say(text: str, *, quiet: bool = False) -> None:
    (sys.stderr if quiet else sys.stdout).write(text + "\n")


def _warn(messages: tuple[str, ...]) -> None:
    for message in messages:
        _say(f"warning: {message}", quiet=True)


def _opened_at(design: Any, loop: Any, at: str | None, delay_at: str | None) -> tuple[str, str | None]:
    at = at or design.tables.analysis.at
    if at is None:
        known = [name for name in loop.signals if name in loop.writers]
        raise DelaytoolsError(
            "at which signal is the loop opened?",
            known=known,
            advice="give --at SIGNAL, or [analysis] at in the design",
        )
    return at, delay_at or design.tables.analysis.delay_at


@app.command()
def margins(
    design: DesignPath,
    at: At = None,
    delay: DelayRange = None,
    delay_at: DelayAt = None,
    configuration: Configuration = None,
    json: Json = None,
    gate: Annotated[
        bool, typer.Option("--gate", help="Exit 1 where the loop is unstable at any delay asked.")
    ] = False,
) -> None:
    """Exact margins of the loop opened at a signal, against an extra delay."""
    from delaytools.analysis.questions import loop_margins
    from delaytools.cli.words import margin_lines

    plan, loop, odd = load(design, configuration)
    _warn(odd)
    at, delay_at = _opened_at(plan, loop, at, delay_at)
    answer = loop_margins(loop, at, delay_range(delay), delay_at=delay_at)
    if json != "-":
        _say("\n".join(margin_lines(answer)))
    if json is not None:
        write_json(margins_answer(answer), json)
    if gate and not all(m.stable for m in answer.margins):
        raise typer.Exit(1)


def margins_answer(answer: Any) -> dict[str, Any]:
    """The answer of `margins` as the contract names it."""
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
    return found | {"at": answer.at, "delay_at": answer.delay_at, "why_approximate": answer.why_approximate}


@app.command()
def roots(
    design: DesignPath,
    at: At = None,
    delay: DelayRange = None,
    gain: Annotated[
        str | None, typer.Option("--gain", metavar="FROM:TO:COUNT", help="Factors on the opened signal.")
    ] = None,
    delay_at: DelayAt = None,
    configuration: Configuration = None,
    count: Annotated[int, typer.Option("--count", min=1, help="Roots per value.")] = 10,
    json: Json = None,
) -> None:
    """Rightmost characteristic roots, each set certified by a count; loci in delay or gain."""
    from delaytools.analysis.questions import loop_roots
    from delaytools.cli.words import root_lines

    plan, loop, odd = load(design, configuration)
    _warn(odd)
    at, delay_at = _opened_at(plan, loop, at, delay_at)
    answer = loop_roots(
        loop, at, delays=delay_range(delay), gains=gain_range(gain), delay_at=delay_at, count=count
    )
    if json != "-":
        _say("\n".join(root_lines(answer)))
    if json is not None:
        listed = [
            {
                "parameter": item.parameter,
                "roots": [[root.real, root.imag] for root in item.roots.tolist()],
                "certified": item.certified,
                "right_of": item.right_of,
                "why": item.why,
            }
            for item in answer.sets
        ]
        rest = {
            "parameter": answer.parameter,
            "sampling": answer.sampling,
            "linearised_without": answer.linearised_without,
        }
        write_json({"roots": listed} | rest, json)


@app.command()
def simulate(
    design: DesignPath,
    configuration: Configuration = None,
    inputs: Annotated[
        str | None, typer.Option("--inputs", metavar="LOG", help="A log whose columns drive the inputs.")
    ] = None,
    duration: Annotated[
        str | None, typer.Option("--duration", metavar="T", help="Length of the run, e.g. 20s.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", metavar="N")] = None,
    out: Annotated[
        str | None, typer.Option("--out", metavar="LOG", help="Write the run as a CSV log.")
    ] = None,
    json: Json = None,
) -> None:
    """Nonlinear time simulation."""
    from delaytools.cli.running import drive
    from delaytools.cli.words import run_lines
    from delaytools.measurement.log_file import read_log, write_log
    from delaytools.simulation.simulate import simulate as run_loop

    plan, loop, odd = load(design, configuration)
    _warn(odd)
    log = read_log(inputs, log_columns(plan, loop)) if inputs is not None else None
    length = seconds(duration, "--duration") if duration is not None else None
    driven = drive(plan, loop, log, length, seed)
    _warn(driven.notes)
    answer = run_loop(
        loop, driven.stimuli, duration=driven.duration, seed=driven.seed, substeps=driven.substeps
    )
    if out is not None:
        write_log(answer.record, out)
    if json != "-":
        _say("\n".join(run_lines(answer)))
    if json is not None:
        rest = {
            "seconds_simulated": answer.seconds_simulated,
            "real_time_factor": answer.real_time_factor,
            "diverged": answer.diverged,
            "notes": driven.notes,
        }
        write_json({"signals": answer.figures} | rest, json)


def run() -> None:
    """The entry point: errors of the user's making become one message and exit status 2."""
    try:
        app(standalone_mode=False)
    except typer.Exit as end:
        sys.exit(end.exit_code)
    except DelaytoolsError as error:
        _say(f"delaytools: {error}", quiet=True)
        sys.exit(2)
    except (KeyboardInterrupt, typer.Abort):
        _say("delaytools: interrupted", quiet=True)
        sys.exit(130)
    except Exception as error:
        if hasattr(error, "format_message"):
            _say(f"delaytools: {error.format_message()}", quiet=True)
            sys.exit(2)
        raise
    sys.exit(0)
