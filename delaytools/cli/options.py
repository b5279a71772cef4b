"""What the commands share: their arguments and options, what they say, and how long work shows its progress."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

__all__ = [
    "At", "Budget", "Configuration", "DelayAt", "DelayRange", "DesignPath", "Gate", "Hold", "Json", "Logs", "progress",
    "say", "share_bar", "warn",
]  # fmt: skip

DesignPath = Annotated[str, typer.Argument(metavar="DESIGN", help="Design file (TOML).")]
Logs = Annotated[list[str], typer.Argument(metavar="LOG...", help="Logs of runs on the bench.")]
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
Hold = Annotated[
    list[str] | None,
    typer.Option("--hold", metavar="INPUT=VALUE", help="An external input held at a value: asks about the rest there."),
]
Budget = Annotated[
    float | None,
    typer.Option("--budget", metavar="SECONDS", min=1.0, help="How long an answer may take; searches end in time."),
]
Gate = Annotated[bool, typer.Option("--gate", help="Exit 1 where the verdict is bad.")]


def say(text: str, *, quiet: bool = False) -> None:
    """A line on standard output, or on standard error where `quiet`."""
    (sys.stderr if quiet else sys.stdout).write(text + "\n")


def warn(messages: tuple[str, ...]) -> None:
    """Warnings on standard error."""
    for message in messages:
        say(f"warning: {message}", quiet=True)


def progress() -> Callable[[str], None]:
    """Says each step on a terminal, nothing when piped."""
    if not sys.stderr.isatty():
        return lambda step: None
    return lambda step: say(f"  {step}", quiet=True)


@contextmanager
def share_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar on a terminal, told (words, share done); nothing when piped."""
    if not sys.stderr.isatty():
        yield lambda words, share: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda words, share: bar.update(task, completed=share, description=f"{title}: {words}")
