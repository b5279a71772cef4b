"""Root loci: how characteristic roots move with one parameter, branch by branch, each followed by continuation."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Protocol, final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.root_path import Family, Line, Meeting, Path, crossing_of, follow, meeting
from delaytools.signals.trouble import AnalysisError

__all__ = ["AxisCrossing", "Branch", "Breakaway", "CountedFamily", "RootLoci", "root_loci"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
SAME = 1e-6  # of a root's size: two that lie nearer are one
LONGEST = 0.25  # step, of the way between two counts
HALVINGS = 10  # of a way between two counts where branches and counts do not agree
ON_AXIS = 1e-12  # of the largest root of a branch
SHOWN = 3  # reasons
BESIDE = 0.1  # of the line: how far left of it a root is looked for that another meets
MOST = 150  # roots in the upper half plane
RANGE, LEFT, LATER = "range", "left", "not followed"


class CountedFamily(Family, Protocol):
    """Roots against a parameter that can also be counted."""

    def counted(self, value: float, line: float) -> tuple[ComplexArray, str]:
        """All points (k,) in the upper half plane with Re s > line, and why they may not be all ("" where they are)."""


@final
@dataclass(frozen=True, eq=False)
class Branch:
    """One root from where it appears to where it leaves: values of the parameter (n,), rising, and roots (n,), rad/s,
    with Im s >= 0.

    begins, ends: "range" at an end of the range, "left" where it comes from or goes to the left of the loci,
    "breakaway" where it meets another, "not followed" where it was lost.
    """

    values: Array
    roots: ComplexArray
    begins: str
    ends: str


@final
@dataclass(frozen=True)
class AxisCrossing:
    """A branch meets the imaginary axis at ±j frequency (rad/s); to_the_right: with a rising parameter."""

    value: float
    frequency: float
    to_the_right: bool


@final
@dataclass(frozen=True)
class Breakaway:
    """Two real roots meet at `root` (rad/s; with an imaginary part where both lie on the edge of the primary strip of a
    sampled loop) and leave as a pair, or (`joins`) a pair meets there and becomes two real roots."""

    value: float
    root: complex
    joins: bool


@final
@dataclass(frozen=True, eq=False)
class RootLoci:
    """All roots right of a line over a range of the parameter ("delay" in s, or "gain").

    checked (n,): values at which roots were counted; right_of (n,): the line there, Re s in rad/s. crossings and
    breakaways by rising value. certified: at every value of `checked` the roots on the branches are all that a count
    finds; why: in words where not.
    """

    parameter: str
    branches: tuple[Branch, ...]
    crossings: tuple[AxisCrossing, ...]
    breakaways: tuple[Breakaway, ...]
    checked: Array
    right_of: Array
    why: str = ""
    sampling: str = "exact"
    linearised_without: tuple[str, ...] = field(default=())

    @property
    def certified(self) -> bool:
        """Whether branches and counts agree everywhere."""
        return not self.why


@final
@dataclass(eq=False)
class _Track:
    """A branch being made."""

    values: list[float]
    points: list[complex]
    begins: str
    ends: str = ""


def root_loci(
    family: CountedFamily, values: Sequence[float], *, right_of: float | Sequence[float], parameter: str = ""
) -> RootLoci:
    """The loci of all roots right of a line (rad/s, one or one for each value) between the first and the last of some
    rising values.

    At each value the roots are counted; in between each is followed by continuation, real ones that meet to where they
    meet and beyond. A root that a count finds and no branch leads to came over the line: it is followed back to it.
    Crossings and breakaways are solved for, not read off a grid. Source of the meeting: the two roots of
    (w - m)² = d pass d = 0 with smooth m and d. Raises AnalysisError for a line with too many roots right of it.
    """
    nodes = np.asarray(values, dtype=float)
    levels = np.broadcast_to(np.asarray(right_of, dtype=float), nodes.shape)
    line = _between_levels(nodes, levels)
    sets = [_few(family, float(value), line) for value in nodes]
    tracks = [_Track([float(nodes[0])], [complex(w)], RANGE) for w in sets[0][0]]
    reasons = [why for _, why in sets if why]
    active, breaks = list(tracks), list[Breakaway]()
    counts = [(last, known, HALVINGS) for last, (known, _) in zip(nodes.tolist(), sets, strict=True)]
    waiting, first = counts[:0:-1], float(nodes[0])
    while waiting:
        last, known, halvings = waiting.pop()
        found = _between(family, active, (first, last), known, (line, halvings == 0))
        if found.lost and halvings:
            middle = 0.5 * (first + last)
            also, why = _few(family, middle, line)
            reasons += [why] if why else []
            waiting += [(last, known, halvings - 1), (middle, also, halvings - 1)]
            continue
        reasons += [f"between {first:g} and {last:g}: {words}" for words in found.lost]
        active, breaks, first = found.active, [*breaks, *found.breaks], last
        tracks += found.new
    for track in active:
        track.ends = RANGE
    branches = tuple(
        Branch(np.array(one.values), family.s(np.array(one.points)), one.begins, one.ends) for one in tracks
    )
    crossings = [at for one in tracks for at in _crossings(family, one)]
    return RootLoci(
        parameter, branches, tuple(sorted(crossings, key=lambda one: one.value)),
        tuple(sorted(breaks, key=lambda one: one.value)), nodes, levels, "; ".join(reasons[:SHOWN]),
    )  # fmt: skip


def _between_levels(nodes: Array, levels: Array) -> Line:
    """The line between its levels: those of a chain of roots go with 1/delay."""
    if levels.max() < 0:
        return lambda value: float(1 / np.interp(value, nodes, 1 / levels))
    return lambda value: float(np.interp(value, nodes, levels))


def _few(family: CountedFamily, value: float, line: Line) -> tuple[ComplexArray, str]:
    """All points right of the line, where they are not too many to follow."""
    points, why = family.counted(value, line(value))
    if len(points) > MOST:
        problem, found = f"too many roots right of {line(value):g} rad/s", f"{len(points)} at {value:g}"
        raise AnalysisError(problem, found=found, advice="draw a line further right")
    return points, why


@final
@dataclass(eq=False)
class _Found:
    """What happened between two counts: branches that go on, new ones, breakaways, what does not agree."""

    active: list[_Track]
    new: list[_Track]
    breaks: list[Breakaway]
    lost: list[str]


def _between(
    family: CountedFamily,
    active: list[_Track],
    span: tuple[float, float],
    known: ComplexArray,
    how: tuple[Line, bool],
) -> _Found:
    """The branches followed from one count to the next; `active` go on where both agree, or (how: the line, and whether
    this is the last try) as far as they do."""
    line, whole = how[0], span[1] - span[0]
    waiting = [(track, track.values[-1], track.points[-1]) for track in active]
    pieces: list[tuple[_Track, Path]] = []
    new, breaks = list[_Track](), list[Breakaway]()
    while waiting:
        begin = waiting[0][1]
        group = [one for one in waiting if one[1] == begin]
        waiting = [one for one in waiting if one[1] != begin]
        step = min(1.0, LONGEST * whole / max(span[1] - begin, 1e-300))
        paths = follow(family, np.array([w for *_, w in group]), (begin, span[1]), line, step)
        pieces += [(track, path) for (track, *_), path in zip(group, paths, strict=True)]
        stuck = [(track, path) for (track, *_), path in zip(group, paths, strict=True) if path.how == "stuck"]
        for pair, met in _meetings(family, stuck, (span[1], line)):
            breaks.append(Breakaway(met.value, complex(family.s(np.array([met.point]))[0]), len(met.points) == 2))
            for track, path in pair:
                path.how = "breakaway"
                path.values.append(met.value)
                path.points.append(met.point)
                if not track.values:  # it came over the line a moment ago
                    pieces.append((track, path))
                    new.append(track)
            born = [_Track([met.value, met.after], [met.point, w], "breakaway") for w in met.points]
            new += born
            waiting += [(track, met.after, track.points[-1]) for track in born]
    return _agreed(family, (active, new, breaks), pieces, (span, known, *how))


_Stuck = tuple[_Track, Path]


def _meetings(
    family: CountedFamily, stuck: list[_Stuck], ends: tuple[float, Line]
) -> list[tuple[tuple[_Stuck, ...], Meeting]]:
    """Those that met before a value (ends: that, and the line): two neighbours on the real axis, one of a pair that
    comes to it, or one whose neighbour was left of the line."""
    end, line = ends
    real = sorted((one for one in stuck if one[1].points[-1].imag == 0), key=lambda one: one[1].points[-1].real)
    found: list[tuple[tuple[_Stuck, ...], Meeting]] = []
    alone = list(real)
    for pair in [*pairwise(real), *((one,) for one in stuck if one[1].points[-1].imag > 0)]:
        met = meeting(family, tuple(path for _, path in pair))
        if met is not None and met.after <= end:
            found.append((pair, met))
            alone = [one for one in alone if one not in pair]
    for one in alone:
        other = _from_the_left(family, one[1], line)
        met = None if other is None else meeting(family, (one[1], other))
        if other is not None and met is not None and met.after <= end:
            found.append(((one, (_Track([], [], LEFT), other)), met))
    return found


def _from_the_left(family: CountedFamily, path: Path, line: Line) -> Path | None:
    """The real root next to a stuck one, at the last two values of that: it came over the line, or is about to."""
    if len(path.values) < 2:
        return None
    here = path.points[-1]
    level, edge = float(family.s(np.array([here]))[0].real), line(path.values[-1])
    points, _ = family.counted(path.values[-1], edge - max(BESIDE * abs(edge), 2 * (level - edge)))
    beside = points[(points.imag == 0) & (np.abs(points - here) > SAME * abs(here))]
    if not len(beside):
        return None
    nearest = beside[np.argmin(np.abs(beside - here))]
    before, good = family.corrected(path.values[-2], np.array([nearest]))
    return Path(path.values[-2:], [complex(before[0]), complex(nearest)], "stuck") if good.all() else None


def _agreed(
    family: CountedFamily,
    made: tuple[list[_Track], list[_Track], list[Breakaway]],
    pieces: list[tuple[_Track, Path]],
    counted: tuple[tuple[float, float], ComplexArray, Line, bool],
) -> _Found:
    """Ends of branches against a count: what is missing is followed back to the line over which it came."""
    (active, new, breaks), (span, known, line, is_last) = made, counted
    left = list(range(len(known)))
    ended, lost = list[_Track](), list[str]()
    for track, path in pieces:
        if path.how == "end" and family.s(np.array([path.points[-1]]))[0].real > line(span[1]):
            place = min(left, key=lambda k: abs(known[k] - path.points[-1]), default=None)
            if place is None or abs(known[place] - path.points[-1]) > SAME * (abs(known[place]) + abs(path.points[0])):
                lost.append(f"a branch ends at {_shown(family, path.points[-1])}, which no count finds")
                continue
            left.remove(place)
            ended.append(track)
        elif path.how == "stuck":
            lost.append(f"a branch is lost at {_shown(family, path.points[-1])}")
    came = follow(family, known[left], (span[1], span[0]), line, LONGEST) if left else []
    for path in came:
        if path.how != "left":
            lost.append(f"a root at {_shown(family, path.points[0])} comes from nowhere")
    if lost and not is_last:
        return _Found(active, [], [], lost)
    for track, path in pieces:
        first = 1 if track.values else 0
        track.values += path.values[first:]
        track.points += path.points[first:]
        track.ends = {"end": "", "stuck": LATER}.get(path.how, path.how)
    back = [
        _Track(path.values[::-1], path.points[::-1], LEFT if path.how == "left" else LATER) for path in came
    ]
    return _Found([*ended, *back], [*new, *back], breaks, lost)


def _shown(family: Family, point: complex) -> str:
    s = complex(family.s(np.array([point]))[0])
    return f"{s.real:.5g}{s.imag:+.5g}j rad/s"


def _crossings(family: Family, track: _Track) -> list[AxisCrossing]:
    """Where a branch meets the imaginary axis."""
    values, points = np.array(track.values), np.array(track.points)
    s = family.s(points)
    off = np.flatnonzero(np.abs(s.real) > ON_AXIS * np.abs(s).max())  # a root that begins on the axis does not cross it
    found = []
    for j, k in pairwise(off):
        if s[j].real * s[k].real < 0:
            ends = (float(values[j]), complex(points[j])), (float(values[k]), complex(points[k]))
            value, point = crossing_of(family, ends, lambda w: float(family.s(np.array([w]))[0].real))
            frequency = abs(float(family.s(np.array([point]))[0].imag))
            found.append(AxisCrossing(value, frequency, bool(s[k].real > 0)))
    return found
