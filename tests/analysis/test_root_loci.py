"""Root loci: published crossings and breakaways, branches against counted roots, loops against their margins."""

from collections.abc import Callable
from itertools import pairwise, permutations

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag

from delaytools.analysis.characteristic_roots import rightmost_roots
from delaytools.analysis.loop_loci import loop_loci
from delaytools.analysis.questions import loop_margins
from delaytools.analysis.root_families import ContinuousFamily, SampledFamily
from delaytools.analysis.root_loci import RootLoci, root_loci
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.linear.algebra import delay, feedback
from delaytools.linear.convert import from_control
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.lifted import LiftedSystem
from delaytools.signals.trouble import AnalysisError

E = np.e
EXACT = 1e-9


def of(numerator: list[float], denominator: list[float]) -> DelaySystem:
    return from_control(control.tf(numerator, denominator))


def against_gain(L: DelaySystem) -> Callable[[float], DelaySystem]:
    return lambda k: feedback(L * k)


# closed loop, values, line; (value, frequency, to the right); (value, root, joins)
PUBLISHED = {
    "1/(s(s+2)): two real roots meet at -1": (
        against_gain(of([1], [1, 2, 0])), (0, 5), -5, [], [(1.0, -1.0, False)],
    ),
    "1/(s(s+1)(s+2)), Ogata: k = 6 at sqrt 2": (
        against_gain(of([1], [1, 3, 2, 0])), (0, 8), -5,
        [(6.0, np.sqrt(2), True)], [(2 * np.sqrt(3) / 9, -1 + 1 / np.sqrt(3), False)],
    ),
    "(s+3)(s+4)/((s+1)(s+2)): away and back": (
        against_gain(of([1, 7, 12], [1, 3, 2])), (0, 60), -12, [],
        [(7 - 4 * np.sqrt(3), -2.5 + np.sqrt(3) / 2, False), (7 + 4 * np.sqrt(3), -2.5 - np.sqrt(3) / 2, True)],
    ),
    "x' = -k x(t-1), Lambert W: 1/e, pi/2, 5 pi/2": (
        against_gain(of([1], [1, 0]) * delay(1.0)), (0.01, 9), -3,
        [(np.pi / 2, np.pi / 2, True), (5 * np.pi / 2, 5 * np.pi / 2, True)], [(1 / E, -1.0, False)],
    ),
    "x' = -10 x(t-tau): the same in tau": (
        lambda tau: feedback(of([10], [1, 0]) * delay(tau)), (0.01, 0.16), -30,
        [(np.pi / 20, 10.0, True)], [(0.1 / E, -10 * E, False)],
    ),
    "10/(s+1) e^(-s tau): every root at one frequency": (
        lambda tau: feedback(of([10], [1, 1]) * delay(tau)), (0, 1), -3,
        [((np.pi - np.arctan(np.sqrt(99)) + 2 * np.pi * m) / np.sqrt(99), np.sqrt(99), True) for m in (0, 1)], [],
    ),
    "1/(s^2+1) with delay: to the left and to the right in turn": (
        lambda tau: feedback(of([0.5], [1, 0, 1]) * delay(tau)), (0.3, 9.0), -0.6, None, [],
    ),
}  # fmt: skip


def loci(name: str) -> RootLoci:
    closed, span, line, *_ = PUBLISHED[name]
    return root_loci(ContinuousFamily(closed), np.linspace(*span, 9).tolist(), right_of=float(line))


@pytest.mark.parametrize("name", PUBLISHED)
def test_crossings_and_breakaways_are_those_published(name: str) -> None:
    *_, crossings, breakaways = PUBLISHED[name]
    found = loci(name)
    assert found.certified, found.why
    if crossings is not None:
        seen = [(one.value, one.frequency, one.to_the_right) for one in found.crossings]
        assert [one[2] for one in seen] == [one[2] for one in crossings]
        assert np.allclose([one[:2] for one in seen], [one[:2] for one in crossings], rtol=EXACT, atol=0)
    seen = [(one.value, one.root, one.joins) for one in found.breakaways]
    assert [one[2] for one in seen] == [one[2] for one in breakaways]
    for (value, root, _), (at, where, _) in zip(seen, breakaways, strict=True):
        assert value == pytest.approx(at, rel=EXACT) and abs(root - where) < 1e-6 * abs(where)


def test_an_undamped_plant_crosses_where_theory_says() -> None:
    """1 + 0.5 e^(-s tau)/(s² + 1) = 0 on the axis: ω² = 1 ± 0.5, at ω τ = 2πm below 1 + ..., π + 2πm above.

    Of the upper pair the magnitude falls with frequency (to the right), of the lower one it rises (to the left).
    """
    found = loci("1/(s^2+1) with delay: to the left and to the right in turn")
    known = [(np.sqrt(1.5), 2 * np.pi * m, True) for m in range(9)]
    known += [(np.sqrt(0.5), np.pi + 2 * np.pi * m, False) for m in range(9)]
    known = sorted((phase / w, w, right) for w, phase, right in known if 0.3 < phase / w < 9.0)
    assert [one.to_the_right for one in found.crossings] == [right for *_, right in known]
    assert np.allclose([(one.value, one.frequency) for one in found.crossings], [one[:2] for one in known], rtol=EXACT)


@pytest.mark.parametrize("name", PUBLISHED)
def test_branches_hold_every_root_that_a_count_finds(name: str) -> None:
    closed, span, line, *_ = PUBLISHED[name]
    found = loci(name)
    for value in np.linspace(*span, 14)[1:-1]:
        known = rightmost_roots(closed(float(value)), right_of=float(line))
        upper = known.roots[known.roots.imag >= 0]
        here = [b for b in found.branches if b.values[0] <= value <= b.values[-1]]
        near = [complex(*(np.interp(value, b.values, part) for part in (b.roots.real, b.roots.imag))) for b in here]
        for root in upper:
            best = min(near, key=lambda s, root=root: abs(s - root))
            assert abs(best - root) < 0.05 * (abs(root) + 1), (value, root)
            near.remove(best)
        assert all(s.real < line + 0.05 * (abs(s) + 1) for s in near), (value, near)


@pytest.mark.parametrize("name", PUBLISHED)
def test_points_of_a_branch_are_roots_and_branches_meet(name: str) -> None:
    closed, *_ = PUBLISHED[name]
    found = loci(name)
    both = [(b, k, how) for b in found.branches for k, how in ((0, b.begins), (-1, b.ends))]
    ends = [(b.values[k], b.roots[k]) for b, k, how in both if how == "breakaway"]
    for one in found.breakaways:
        assert sum(at == one.value and abs(s - one.root) < 1e-9 for at, s in ends) == 3
    for b in found.branches:
        assert np.all(np.diff(b.values) > 0) and len(b.values) > 1
        for k in range(1, len(b.values) - 1, 7):
            matrix = closed(float(b.values[k])).without_zero_delays().characteristic_matrix(b.roots[k])
            sizes = np.linalg.svd(matrix, compute_uv=False)
            assert sizes[-1] < 1e-9 * sizes[0]


@settings(max_examples=6, deadline=None)
@given(scale=st.floats(0.01, 100.0), tau=st.floats(0.05, 0.4))
def test_loci_scale_with_time(scale: float, tau: float) -> None:
    """s -> s scale where every time constant and delay is divided by it."""
    gains = [0.0, 2.0, 5.0]
    L = of([1], [1, 3, 2, 0]) * delay(tau)
    plain = root_loci(ContinuousFamily(against_gain(L)), gains, right_of=-4.0)
    L = of([scale**3], [1, 3 * scale, 2 * scale**2, 0]) * delay(tau / scale)
    other = root_loci(ContinuousFamily(against_gain(L)), gains, right_of=-4.0 * scale)
    assert plain.certified and other.certified
    ours, theirs = ([(c.value, c.frequency) for c in found.crossings] for found in (plain, other))
    assert len(ours) == len(theirs)
    for (value, frequency), (again, faster) in zip(ours, theirs, strict=True):
        assert again == pytest.approx(value, rel=1e-9) and faster == pytest.approx(scale * frequency, rel=1e-9)
    ours, theirs = ([b.value for b in found.breakaways] for found in (plain, other))
    assert theirs == pytest.approx(ours, rel=1e-7)


BENCH = """
frame = "1 ms"
[blocks.autopilot]
type = "{computer}"
input = "3*(0 - angle) - 0.4*rate"
output = "command"
{period}
[blocks.table]
type = "second_order"
input = "command"
output = "moved"
natural_frequency = "120 rad/s"
damping = 0.6
[blocks.axis]
type = "equations"
inputs = {{ u = "moved" }}
states = {{ q = 0.0, p = 0.0 }}
rates = {{ q = "p", p = "20*u - 0.5*p" }}
outputs = {{ angle = "q", rate = "p" }}
"""
BENCHES = {
    "continuous": BENCH.format(computer="gain", period="gain = 1.0"),
    "sampled": BENCH.format(computer="sample_hold", period='period = "5 ms"'),
}


@pytest.mark.parametrize("name", BENCHES)
def test_the_first_crossing_is_the_margin(name: str) -> None:
    loop = build(parse_design(BENCHES[name]))
    known = loop_margins(loop, "command", [0.0], delay_at="table.input").margins[0]
    late = loop_loci(loop, "command", delays=(0.0, 2 * known.delay_margin), delay_at="table.input")
    loud = loop_loci(loop, "command", gains=(0.5, 2 * known.gain_margin))
    assert late.certified and loud.certified and late.sampling == loud.sampling == "exact"
    assert late.crossings[0].value == pytest.approx(known.delay_margin, rel=1e-8)
    assert loud.crossings[0].value == pytest.approx(known.gain_margin, rel=1e-8)
    assert loud.crossings[0].frequency == pytest.approx(known.gain_margin_frequency, rel=1e-8)


def test_roots_on_the_edge_of_the_strip_meet_there() -> None:
    """A sampled loop's z may become real and negative: two roots at ±jπ/T that part or join."""
    loop = build(parse_design(BENCHES["sampled"]))
    found = loop_loci(loop, "command", delays=(0.0, 0.05), delay_at="table.input", right_of=-600.0)
    assert found.certified
    on_edge = [one for one in found.breakaways if one.root.imag == pytest.approx(np.pi / 0.005)]
    assert on_edge
    for one, two in pairwise(sorted(b.value for b in found.breakaways)):
        assert one < two


def test_a_line_with_more_roots_than_anyone_can_look_at_is_refused() -> None:
    family = ContinuousFamily(lambda tau: feedback(of([10], [1, 0]) * delay(tau)))
    with pytest.raises(AnalysisError, match="right of"):
        root_loci(family, [0.1, 0.5], right_of=-15.0)


def test_real_guesses_that_met_leave_a_third_its_own_eigenvalue() -> None:
    pair = np.array([[-0.19, 1.0], [-1e-6, -0.19]])  # -0.19 ± 0.001j
    family = SampledFamily(lambda _: LiftedSystem(0.005, block_diag(pair, [[-0.00744]]), *EMPTY), 0.005)
    for order in permutations([-0.19175, -0.19173, -0.00743]):
        found, good = family.corrected(0.0, np.array(order, dtype=complex))
        assert good.tolist() == [guess == -0.00743 for guess in order]
        assert found[good].tolist() == [-0.00744]


EMPTY = np.zeros((3, 0)), np.zeros((0, 3)), np.zeros((0, 0))
BOTH = {"delays": (0.0, 0.1), "gains": (0.0, 1.0)}


@pytest.mark.parametrize("how", [{}, BOTH, {"delays": (0.1, 0.0)}, {"gains": (2, 2)}])
def test_a_range_that_is_none_is_refused(how: dict[str, tuple[float, float]]) -> None:
    with pytest.raises(AnalysisError):
        loop_loci(build(parse_design(BENCHES["continuous"])), "command", **how)
