"""The command plot: Bode, Nichols and Nyquist plots with margins, configurations and delays overlaid."""

from typing import Annotated, Any

import typer

from delaytools.cli.options import At, DelayAt, DelayRange, DesignPath, Hold, say
from delaytools.cli.reading import delay_range, opened_loop
from delaytools.signals.trouble import DelaytoolsError

__all__ = ["plot"]

KINDS = ("bode", "nichols", "nyquist")
MOST = 9  # curves: as many as there are colours


def plot(
    design: DesignPath,
    kind: Annotated[str, typer.Option("--kind", metavar="KIND", help="bode, nichols or nyquist.")] = "bode",
    configuration: Annotated[
        list[str] | None, typer.Option("--configuration", metavar="NAME", help="A variant; several are overlaid.")
    ] = None,
    at: At = None,
    delay: DelayRange = None,
    delay_at: DelayAt = None,
    hold: Hold = None,
    out: Annotated[str, typer.Option("--out", metavar="FILE", help="The figure: .png, .svg or .pdf.")] = "plot.png",
) -> None:
    """The opened loop with its margins marked; configurations and extra delays overlaid."""
    if kind not in KINDS:
        raise DelaytoolsError("no such plot", where="--kind", found=repr(kind), known=KINDS)
    from delaytools.report.figure_bode import draw_bode, draw_nichols
    from delaytools.report.figure_nyquist import draw_nyquist
    from delaytools.report.style import colours
    from delaytools.report.write import write_figure

    loops = _loops(design, configuration or [None], (at, delay_at, hold), delay_range(delay) or [0.0])
    look = colours([one.curve.name for one in loops])
    first = loops[0].margins
    verdict = "" if all(one.margins.stable for one in loops) else "; not all closed loops are stable"
    message = f"Opened loop, sampling: {first.sampling}{verdict}"
    if kind == "nyquist":
        figure = draw_nyquist(tuple(one.curve for one in loops), look, message)
    else:
        figure = (draw_bode if kind == "bode" else draw_nichols)(loops, look, message)
    write_figure(figure, out)
    say(f"{out}: {', '.join(one.curve.name for one in loops)}")


def _loops(design: str, names: list[Any], where: tuple[Any, ...], delays: list[float]) -> list[Any]:
    """One curve with its margins for each configuration and delay."""
    from delaytools.analysis.questions import loop_margins
    from delaytools.report.figure_bode import Marked
    from delaytools.report.nyquist import nyquist_curve

    if len(names) * len(delays) > MOST:
        found = f"{len(names) * len(delays)} of them"
        raise DelaytoolsError("too many curves to tell apart", found=found, advice=f"ask for {MOST} at most")
    loops = []
    for name in names:
        loop, at, port = opened_loop(design, name, *where)
        for tau in delays:
            margins = loop_margins(loop, at, [tau], delay_at=port).margins[0]
            words = name or "as written"
            label = f"{words}, {tau * 1e3:g} ms" if len(delays) > 1 or tau else words
            loops.append(Marked(nyquist_curve(loop, at, label, margins, delay_at=port), margins))
    return loops
