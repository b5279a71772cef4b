"""Where a model fails first, in words."""

from collections.abc import Sequence

from delaytools.measurement.comparison import SignalComparison

__all__ = ["where_it_fails"]


def where_it_fails(signals: Sequence[SignalComparison], tolerated: Sequence[str]) -> str:
    """The first failing signal in signal order, with its blocks, and what its error looks like."""
    failing = [one for one in signals if one.verdict == "fails"]
    if not signals:
        return "no measured signal could be compared"
    if not failing:
        return "every measured signal is explained by the model within its noise"
    first = failing[0]
    blocks = ", ".join(first.blocks)
    driven = ", ".join(first.driven_by) or "nothing that is measured"
    parts = [
        f"{first.signal} fails first: between {driven} and {first.signal} ({_count(first.blocks)} {blocks})"
    ]
    parts += [word for word in (_timing(first), _band(first), _level(first)) if word]
    others = [one.signal for one in failing[1:]]
    if others:
        parts.append(
            f"{', '.join(others)} {'fails' if len(others) == 1 else 'fail'} too"
        )
    own = [path for path in tolerated if path.partition(".")[0] in first.blocks]
    if own:
        parts.append(f"{', '.join(own)} may be off by tolerance, without anything missing")
    return "; ".join(parts)


def _count(blocks: Sequence[str]) -> str:
    return "block" if len(blocks) == 1 else "blocks"


def _timing(one: SignalComparison) -> str:
    shift = one.overall.shift
    if shift.seconds is None or not shift.error_before or shift.error_after is None:
        return ""
    gain = 1 - shift.error_after / shift.error_before
    if gain < 0.1:
        return "no time shift helps: it is no matter of timing"
    way = "later" if shift.seconds > 0 else "earlier"
    return f"shifted by {abs(shift.seconds) * 1e3:.3g} ms ({way} than the model) the error falls by {100 * gain:.0f} %"


def _band(one: SignalComparison) -> str:
    if not one.worst_bands:
        return ""
    low, high, share, _ = one.worst_bands[0]
    return f"{100 * share:.0f} % of the squared error lies between {low:.3g} and {high:.3g} Hz"


def _level(one: SignalComparison) -> str:
    if not one.worst_levels:
        return ""
    level = one.worst_levels[0]
    times = level.share / max(level.share_of_time, 1e-300)
    unit = f" {level.unit}" if level.unit else ""
    span = f"{_plain(level.low)} to {_plain(level.high)}{unit}"
    return f"it is {times:.1f} times its mean while the {level.quantity} is {span}"


def _plain(value: float) -> str:
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"
