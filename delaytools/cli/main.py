"""The command line: each command reads, calls one function of the Python API, and writes."""

import os
import sys
from typing import Annotated, Any

import typer

from delaytools.cli import cycles, maps, margins, measured, plots
from delaytools.cli.answers import check_targets, write_json
from delaytools.cli.options import (
    At,
    Budget,
    Configuration,
    DelayAt,
    DelayRange,
    DesignPath,
    Hold,
    Json,
    progress,
    say,
    warn,
)
from delaytools.cli.reading import delay_range, gain_range, load, log_columns, opened_at, opened_loop, seconds
from delaytools.signals.trouble import DelaytoolsError

# The matrices here are small: threads in the linear algebra cost more than they bring.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__all__ = ["app", "run"]

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Delay in hardware-in-the-loop benches: exact margins, roots, runs, tuning, reports.",
)


app.command()(margins.margins)


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
    loci: Annotated[
        bool, typer.Option("--loci", help="Follow every root over the range: branches, crossings, breakaways.")
    ] = False,
    hold: Hold = None,
    json: Json = None,
) -> None:
    """Rightmost characteristic roots, each set certified by a count; loci in delay or gain."""
    from delaytools.analysis.questions import loop_roots
    from delaytools.cli.loci import followed, loci_lines, loci_table
    from delaytools.cli.words import root_lines

    check_targets(json)
    loop, at, delay_at = opened_loop(design, configuration, at, delay_at, hold)
    delays, gains = delay_range(delay), gain_range(gain)
    answer = loop_roots(loop, at, delays=delays, gains=gains, delay_at=delay_at, count=count)
    drawn = followed(loop, at, delays, gains, delay_at, count) if loci else None
    if json != "-":
        say("\n".join([*root_lines(answer), *(loci_lines(drawn) if drawn else [])]))
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
            "small_delays": answer.small_delays,
        }
        write_json({"roots": listed} | rest | ({"loci": loci_table(drawn)} if drawn else {}), json)


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

    check_targets(json, log=out)
    plan, loop, odd = load(design, configuration)
    warn(odd)
    log = read_log(inputs, log_columns(plan, loop)) if inputs is not None else None
    length = seconds(duration, "--duration") if duration is not None else None
    driven = drive(plan, loop, log, length, seed)
    warn(driven.notes)
    answer = run_loop(
        loop, driven.stimuli, duration=driven.duration, seed=driven.seed, substeps=driven.substeps
    )
    if out is not None:
        write_log(answer.record, out)
    if json != "-":
        say("\n".join(run_lines(answer)))
    if json is not None:
        rest = {
            "seconds_simulated": answer.seconds_simulated,
            "real_time_factor": answer.real_time_factor,
            "diverged": answer.diverged,
            "notes": driven.notes,
        }
        write_json({"signals": answer.figures} | rest, json)


@app.command()
def tune(
    design: DesignPath,
    configuration: Configuration = None,
    at: At = None,
    delay_at: DelayAt = None,
    json: Json = None,
    out: Annotated[str | None, typer.Option("--out", metavar="FILE", help="Write the tuned design.")] = None,
    gate: Annotated[bool, typer.Option("--gate", help="Exit 1 where a goal is not met.")] = False,
) -> None:
    r"""Tune what \[tuning] names, on the exact-delay loop, against the loop that flies."""
    from delaytools.cli.words import tuned_lines
    from delaytools.design.file import write_design
    from delaytools.tuning.tune_design import tune_design
    from delaytools.tuning.tuned_design import tuned_design

    check_targets(json, out)
    plan, loop, odd = load(design, configuration)
    warn(odd)
    at, delay_at = opened_at(plan, loop, at, delay_at)
    configuration = configuration or plan.tables.tuning.configuration
    answer = tune_design(plan, configuration, at=at, delay_at=delay_at)
    if out is not None:
        write_design(tuned_design(plan, configuration, answer), out)
    if json != "-":
        say("\n".join(tuned_lines(answer)))
    if json is not None:
        rest = {name: getattr(answer, name) for name in answer.__dataclass_fields__ if name != "values"}
        write_json({"tuned": answer.values} | rest, json)
    if gate and not answer.met:
        raise typer.Exit(1)


@app.command()
def fit(
    log: Annotated[str, typer.Argument(metavar="LOG", help="Log file (CSV).")],
    input: Annotated[str, typer.Option("--input", metavar="A", help="Signal that drives.")],
    output: Annotated[str, typer.Option("--output", metavar="B", help="Signal that answers.")],
    delay: Annotated[bool, typer.Option("--delay", help="Fit an equivalent delay too.")] = False,
    json: Json = None,
) -> None:
    """Second-order low-order equivalent system between two signals of a log, with confidence limits."""
    from delaytools.cli.words import fit_lines
    from delaytools.estimation.low_order import fit as fit_record
    from delaytools.measurement.log_file import read_log
    from delaytools.measurement.staircase import with_staircases_held

    check_targets(json)
    record, notes = with_staircases_held(read_log(log))
    warn(tuple(note for note in notes if note.split()[0] in (input, output)))
    answer = fit_record(record, input, output, delay=delay)
    if json != "-":
        say("\n".join(fit_lines(answer)))
    if json is not None:
        names = [name for name in answer.__dataclass_fields__ if name != "estimate"]
        write_json({name: getattr(answer, name) for name in names}, json)


app.command()(cycles.limit_cycle)
app.command()(maps.stability_map)
app.command()(plots.plot)
app.command()(measured.compare)
app.command()(measured.diagnose)
app.command()(measured.improve)


@app.command()
def report(
    design: DesignPath,
    logs: Annotated[list[str] | None, typer.Argument(metavar="[LOG]...", help="Logs to hold it against.")] = None,
    out: Annotated[
        str, typer.Option("--out", metavar="DIR", help="Where the report is written.")
    ] = "reports",
    tuning: Annotated[bool, typer.Option(help=r"Tune what \[tuning] names first, and show it.")] = True,
    configuration: Configuration = None,
    search: Annotated[bool, typer.Option(help="Search the logs for missing effects.")] = True,
    budget: Budget = None,
    json: Json = None,
) -> None:
    """The design report, one HTML page and a PDF; with logs, the model against what was measured too.

    --configuration names the variant in which the logs were taken.
    """
    from delaytools.report.write import write_report
    from delaytools.tuning.tune_design import tune_design
    from delaytools.tuning.tuned_design import tuned_design

    check_targets(json, directory=out)
    plan, loop, odd = load(design, configuration)
    warn(odd)
    tell = progress()
    found_in_logs = None
    if logs:
        found_in_logs = measured.evidence(plan, loop, logs, configuration, search=search, budget=budget)
    wishes = plan.tables.tuning
    if tuning and wishes.goals and plan.tables.analysis.at is not None:
        tell("tuning")
        asked = plan.tables.analysis
        found = tune_design(plan, wishes.configuration, at=asked.at, delay_at=asked.delay_at)
        plan = tuned_design(plan, wishes.configuration, found)
    answer = write_report(plan, out, progress=tell, evidence=found_in_logs)
    if json != "-":
        say("\n".join(answer.pages))
    if json is not None:
        write_json({"pages": list(answer.pages), "figures": list(answer.figures)}, json)


def run() -> None:
    """The entry point: errors of the user's making become one message and exit status 2."""
    code: Any = 0
    try:
        code = app(standalone_mode=False)  # a typer.Exit comes back as its exit status
    except typer.Exit as end:
        code = end.exit_code
    except BrokenPipeError:  # the reader of our output has gone: nothing is left to say
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except DelaytoolsError as error:
        say(f"delaytools: {error}", quiet=True)
        sys.exit(2)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Exception as error:
        if hasattr(error, "format_message"):
            say(_usage(error), quiet=True)
            sys.exit(2)
        if os.environ.get("DELAYTOOLS_TRACEBACK"):
            raise
        advice = (
            "this is a fault of delaytools, not of the input; DELAYTOOLS_TRACEBACK=1 shows where it happened"
        )
        say(f"delaytools: internal error: {type(error).__name__}: {error}; {advice}", quiet=True)
        sys.exit(2)
    if code == 130:
        _interrupted()
    sys.exit(code if isinstance(code, int) else 0)


def _interrupted() -> None:
    """Say so, and let the exit status be 130.

    Where the interrupt arrived inside an `exec` of some text (a dataclass in the making), CPython remembers it and
    would end the process by the signal although it was caught; the next `exec` of a text makes it forget.
    """
    exec("")
    say("delaytools: interrupted", quiet=True)


def _usage(error: Any) -> str:
    """What is wrong with the words of the command line, and where to read on."""
    context = getattr(error, "ctx", None)
    name = f"delaytools {context.info_name}" if context and context.parent is not None else "delaytools"
    words = error.format_message().rstrip(".") or "which command?"
    return f"delaytools: {words}; see: {name} --help"
