"""Root loci on the command line: asked for, in words, and as a table."""

import math
from collections.abc import Sequence
from typing import Any

from delaytools.signals.trouble import DelaytoolsError

__all__ = ["followed", "loci_lines", "loci_table"]

ENDS = {
    "range": "the end of the range", "left": "the left", "breakaway": "a breakaway", "not followed": "lost",
}  # fmt: skip


def followed(
    loop: Any, at: str, delays: Sequence[float] | None, gains: Sequence[float] | None, delay_at: str | None, count: int
) -> Any:
    """The loci over the range that was given."""
    from delaytools.analysis.loop_loci import loop_loci

    values = delays if delays is not None else gains
    if values is None or len(values) < 2:
        raise DelaytoolsError("loci go over a range", advice="give --delay FROM:TO:COUNT or --gain FROM:TO:COUNT")
    span = float(values[0]), float(values[-1])
    return loop_loci(
        loop, at, delays=span if delays is not None else None, gains=span if delays is None else None,
        delay_at=delay_at, count=count,
    )  # fmt: skip


def loci_lines(loci: Any) -> list[str]:
    """Crossings and breakaways, then where every branch begins and ends."""
    first, last = loci.right_of[0], loci.right_of[-1]
    line = f"{first:.5g}" if first == last else f"a line from {first:.5g} to {last:.5g}"
    lines = [f"root loci right of {line} rad/s; sampling: {loci.sampling}"]
    for one in loci.crossings:
        way = "to the right" if one.to_the_right else "to the left"
        lines.append(
            f"  {_value(loci, one.value)}: crosses the axis {way} at {one.frequency:.5f} rad/s, "
            f"{one.frequency / (2 * math.pi):.4f} Hz"
        )
    for one in loci.breakaways:
        what = "a pair becomes two real roots" if one.joins else "two real roots become a pair"
        lines.append(f"  {_value(loci, one.value)}: {what} at {_root(one.root)}")
    lines.append(f"  {len(loci.branches)} branches, a pair counted once")
    for one in loci.branches:
        lines.append(
            f"    {_root(one.roots[0])} at {_value(loci, one.values[0])} (from {ENDS[one.begins]}) to "
            f"{_root(one.roots[-1])} at {_value(loci, one.values[-1])} ({ENDS[one.ends]})"
        )
    return lines + ([f"  not certified: {loci.why}"] if loci.why else [])


def loci_table(loci: Any) -> dict[str, Any]:
    """Everything, in SI."""
    return {
        "branches": [
            {"values": one.values.tolist(), "roots": [[s.real, s.imag] for s in one.roots.tolist()],
             "begins": one.begins, "ends": one.ends}
            for one in loci.branches
        ],
        "crossings": [vars(one) for one in loci.crossings],
        "breakaways": [
            {"value": one.value, "root": [one.root.real, one.root.imag], "joins": one.joins} for one in loci.breakaways
        ],
        "right_of": loci.right_of.tolist(), "checked": loci.checked.tolist(),
        "certified": loci.certified, "why": loci.why,
    }  # fmt: skip


def _value(loci: Any, value: float) -> str:
    return f"{value * 1e3:.6g} ms" if loci.parameter == "delay" else f"factor {value:.6g}"


def _root(root: complex) -> str:
    return f"{root.real:.5g}{root.imag:+.5g}j" if abs(root.imag) > 0 else f"{root.real:.5g}"
