"""The delay budget: what is spent in every configuration, and element by element in one of them."""

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from delaytools.report.budget import Budget, BudgetEntry
from delaytools.report.style import BENCH, GREY, VEHICLE, axes_of, in_style, new_figure, title

__all__ = ["draw_budgets", "draw_waterfall"]

_PLATE = {"boxstyle": "square,pad=0.12", "fc": "white", "ec": "none"}
_VEHICLE = ("#08519c", "#3182bd", "#6baed6", "#9ecae1", "#084594", "#4292c6", "#c6dbef")
_BENCH = ("#D55E00", "#f28e42", "#fdbe85", "#a63603", "#fdd0a2")


@in_style
def draw_budgets(budgets: tuple[Budget, ...], message: str) -> Figure:
    """One bar for each configuration: delay by element (bench hatched), then what the loop can still stand."""
    figure = new_figure(1.2 + 0.28 * len(budgets))
    panel = axes_of(figure)[0][0]
    shades = _shades(budgets)
    named: set[str] = set()
    for row, item in enumerate(budgets):
        end = _bar(panel, row, item, shades, named)
        left = item.delay_margin
        if left:
            panel.barh(row, left * 1e3, left=end, height=0.62, fill=False, ec="#009E73", ls="--", lw=1.1,
                       label="" if "left" in named else "delay margin left")  # fmt: skip
            named.add("left")
            words = f"{left * 1e3:.2f} ms left"
        else:
            words = item.why or "unstable"
        panel.annotate(words, (end + (left or 0) * 1e3, row), (4, 0), textcoords="offset points", va="center",
                       fontsize=7.2, color="#00704f" if left else "#B00020")  # fmt: skip
    _dress(panel, [item.name for item in budgets], "Low-frequency delay round the loop (ms)")
    panel.margins(x=0.16)
    panel.set_xlim(left=0)
    handles = dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    order = [w for name in shades for w in (name, f"{name} (bench)") if w in handles]
    order += [w for w in handles if w not in order]
    figure.legend(
        [handles[w] for w in order], order, loc="outside lower center", ncols=min(6, len(order)), fontsize=7.2
    )
    title(figure, message)
    return figure


def _bar(panel: Axes, row: int, item: Budget, shades: dict[str, str], named: set[str]) -> float:
    """Positive delays to the right from 0; a lead takes back from the end. Returns where the bar ends, ms."""
    end = 0.0
    for entry in item.entries:
        if not entry.added or not entry.delay:
            continue
        width = entry.delay * 1e3
        panel.barh(row, width, left=end, height=0.62 if width > 0 else 0.2, color=shades[entry.name],
                   ec="white", lw=0.8, hatch="////" if entry.bench else None,
                   label="" if entry.name in named else _label(entry))  # fmt: skip
        named.add(entry.name)
        end += width
    return end


def _label(entry: BudgetEntry) -> str:
    return f"{entry.name} (bench)" if entry.bench else entry.name


def _shades(budgets: tuple[Budget, ...]) -> dict[str, str]:
    found: dict[str, str] = {}
    longest = sorted(budgets, key=lambda item: -len(item.entries))
    for bench, ramp in ((False, _VEHICLE), (True, _BENCH)):
        names = dict.fromkeys(
            e.name for b in longest for e in b.entries if e.bench == bench and e.added and e.delay
        )
        found |= {name: ramp[i % len(ramp)] for i, name in enumerate(names)}
    return found


def _dress(panel: Axes, names: list[str], label: str) -> None:
    panel.set_yticks(range(len(names)), names)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.grid(visible=False, axis="y")
    panel.set_xlabel(label)


@in_style
def draw_waterfall(item: Budget, message: str) -> Figure:
    """Element by element: delay (left) and phase at the crossover (right), each bar starting where the last ended."""
    shown = [e for e in item.entries if e.series and (e.delay or e.phase)]
    figure = new_figure(1.1 + 0.225 * (len(shown) + 2))
    left, right = axes_of(figure, 1, 2, share=(False, True))[0]
    added = [(e.delay or 0.0) * 1e3 if e.added else None for e in shown]
    _steps(left, shown, added, "{:.2f}")
    _steps(right, shown, [None if e.phase is None else math.degrees(e.phase) for e in shown], "{:.1f}")
    names = [e.name for e in shown]
    _dress(left, [*names, "sum"], "Delay, running sum (ms)")
    right.set_xlabel("Phase at the gain crossover, running sum (deg)")
    right.grid(visible=False, axis="y")
    if item.delay_margin is not None:
        edge = (item.total + item.delay_margin) * 1e3
        left.axvline(edge, color="#009E73", ls="--", lw=1.2)
        left.text(edge, 1.01, f"unstable from {edge:.1f} ms", transform=left.get_xaxis_transform(), ha="center",
                  fontsize=7, color="#00704f")  # fmt: skip
    right.axvline(-180, color="#B00020", ls="--", lw=1.0)
    right.text(
        -180,
        1.01,
        "-180 deg",
        transform=right.get_xaxis_transform(),
        ha="center",
        fontsize=7,
        color="#B00020",
    )
    right.invert_xaxis()
    title(figure, message)
    return figure


def _steps(panel: Axes, shown: list[BudgetEntry], values: list[float | None], form: str) -> None:
    start, turn = 0.0, 1 if sum(v or 0 for v in values) >= 0 else -1
    for row, (entry, value) in enumerate(zip(shown, values, strict=True)):
        if value is None:
            panel.annotate("no delay at the crossover", (start, row), (4, 0), textcoords="offset points", va="center",
                           fontsize=7, color=GREY)  # fmt: skip
            continue
        panel.barh(row, value, left=start, height=0.6, color=BENCH if entry.bench else VEHICLE,
                   hatch="////" if entry.bench else None, ec="white", lw=0.4)  # fmt: skip
        end = max(start, start + value, key=lambda x: x * turn)
        panel.annotate(form.format(value), (end, row), (4, 0), textcoords="offset points", va="center", fontsize=7,
                       bbox=_PLATE, zorder=4)  # fmt: skip
        start += value
    panel.barh(len(shown), start, height=0.6, color=GREY)
    panel.annotate(form.format(start), (start, len(shown)), (4, 0), textcoords="offset points", va="center",
                   fontsize=7.2, fontweight="bold", bbox=_PLATE, zorder=4)  # fmt: skip
    panel.margins(x=0.2)
