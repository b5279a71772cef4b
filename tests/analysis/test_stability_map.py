"""Stability maps: published boundaries, curves against the characteristic equation, counts against single questions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from delaytools.analysis.characteristic_roots import unstable_count
from delaytools.analysis.loop_map import loop_map
from delaytools.analysis.map_rows import Row, joined_rows
from delaytools.analysis.questions import loop_margins, loop_roots
from delaytools.analysis.stability_map import StabilityMap, delay_factor_map, two_delay_map
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.linear.delay_system import DelaySystem
from delaytools.loop.values import with_numbers
from delaytools.signals.trouble import AnalysisError
from tests.analysis.test_root_loci import BENCHES

SMALL = (31, 9)
PORT, PARAMETER = "table.input", "table.natural_frequency"


def scalar(a: float, b: float, c: float = 0.0) -> DelaySystem:
    """x' = -c x - a x(t - τ₁) - b x(t - τ₂), opened at both delays."""
    return DelaySystem(
        A=np.array([[-c]]), B1=np.array([[-a, -b]]), B2=np.zeros((1, 0)), C1=np.array([[1.0], [1.0]]),
        C2=np.zeros((0, 1)), D11=np.zeros((2, 2)), D12=np.zeros((2, 0)), D21=np.zeros((0, 2)), D22=np.zeros((0, 0)),
        channels=(),
    )  # fmt: skip


def off(found: StabilityMap, a: float, b: float, c: float) -> float:
    """The largest |characteristic equation| at the curves' own frequencies."""
    worst = 0.0
    for one in found.curves:
        s = 1j * one.frequency
        second = b * np.exp(-s * one.y) if found.names[1] == "delay" else b * one.y
        worst = max(worst, float(np.abs(s + c + a * np.exp(-s * one.x) + second).max()))
    return worst


def test_hayes_region() -> None:
    """x' = -k x - x(t - τ) is stable where 1 > k > 0 for τ < arccos(-k)/√(1 - k²), for k > 1 always (Hayes 1950)."""
    found = delay_factor_map(scalar(1.0, 1.0), (0.0, 8.0), (0.05, 1.5), SMALL)
    first = [one for one in found.curves if np.min(one.x) < np.pi]
    assert off(found, 1.0, 1.0, 0.0) < 1e-12 and first
    for one in found.curves:
        k = one.y[one.y < 1]
        turns = (one.x[one.y < 1] * np.sqrt(1 - k**2) - np.arccos(-k)) / (2 * np.pi)
        assert np.allclose(turns, np.round(turns), atol=1e-9)
    for j, k in enumerate(found.grid_y):
        limit = np.arccos(-k) / np.sqrt(1 - k**2) if k < 1 else np.inf
        assert np.array_equal(found.counts[j] == 0, found.grid_x < limit)


def test_two_delays_of_a_scalar() -> None:
    """x' = -a x(t - τ₁) - b x(t - τ₂), Hale & Huang (1993): through (π/2/(a+b), the same) and with τ₂ = 0 as Hayes."""
    found = two_delay_map(scalar(1.0, 2.0), (0.0, 4.0), (0.0, 2.0), SMALL)
    assert off(found, 1.0, 2.0, 0.0) < 1e-11
    nearest = min(float(np.hypot(one.x - np.pi / 6, one.y - np.pi / 6).min()) for one in found.curves)
    assert nearest < 5e-3
    assert found.counts[0, 0] == 0 and np.all(found.counts[0] == 0)  # b > a and τ₂ = 0: whatever τ₁


@settings(max_examples=10, deadline=None)
@given(a=st.floats(0.3, 3.0), b=st.floats(0.3, 3.0), c=st.floats(0.0, 2.0), data=st.data())
def test_counts_are_those_of_a_single_question(a: float, b: float, c: float, data: st.DataObject) -> None:
    for make, name in ((two_delay_map, "delay"), (delay_factor_map, "gain")):
        found = make(scalar(a, b, c), (0.05, 3.0), (0.1, 2.0), (13, 4))
        assert off(found, a, b, c) < 1e-9
        i, j = data.draw(st.integers(0, 12)), data.draw(st.integers(0, 3))
        tau, other = float(found.grid_x[i]), float(found.grid_y[j])
        matrices = [[[-c if name == "delay" else -c - b * other]], [[-a]], [[-b if name == "delay" else 0.0]]]
        delays = [tau, other] if name == "delay" else [tau, 1.0]
        known = unstable_count(_delayed(matrices, delays))
        assert found.counts[j, i] == known.count


def _delayed(matrices: list[list[list[float]]], delays: list[float]) -> DelaySystem:
    from delaytools.linear.algebra import from_delay_differential

    return from_delay_differential(matrices, [0.0, *delays])


@pytest.mark.parametrize("make", [two_delay_map, delay_factor_map])
def test_roots_are_unstable_on_the_side_to_which_a_curve_points(make: object) -> None:
    found = make((P := scalar(1.0, 2.0)), (0.0, 4.0), (0.05, 2.0), SMALL)  # type: ignore[operator]
    wide = np.array([4.0, 2.0])
    for one in found.curves:
        for k in range(1, len(one.x) - 1, max(1, len(one.x) // 5)):
            here = np.array([one.x[k], one.y[k]])
            side = one.towards[k] * wide / np.linalg.norm(one.towards[k] * wide) * wide * 1e-4
            if (here - np.abs(side) <= 0).any():
                continue
            corners = [[(at, at + 1e-9) for at in place] for place in (here + side, here - side)]
            sides = [make(P, *corner, (2, 2)).counts[0, 0] for corner in corners]  # type: ignore[operator]
            assert sides[0] - sides[1] == 2, (here, sides)


def test_delays_one_after_the_other_add_up() -> None:
    loop = build(parse_design(BENCHES["continuous"]))
    margin = loop_margins(loop, "command", [0.0], delay_at=PORT).margins[0].delay_margin
    found = loop_map(loop, "command", (0.0, 0.2), delay_at=PORT, second=("axis.u", (0.0, 0.1)))
    assert found.sampling == "exact" and len(found.curves) >= 1
    assert np.allclose(found.curves[0].x + found.curves[0].y, margin, rtol=1e-9)


@pytest.mark.parametrize("name", BENCHES)
def test_a_loop_over_delay_and_gain(name: str) -> None:
    loop = build(parse_design(BENCHES[name]))
    known = loop_margins(loop, "command", [0.0], delay_at=PORT).margins[0]
    found = loop_map(loop, "command", (0.0, 0.15), delay_at=PORT, gains=(0.6, 14.0))
    assert found.sampling == "exact"
    ends = np.concatenate([np.stack([one.x, one.y], axis=1) for one in found.curves])
    at_one = ends[np.argsort(np.abs(ends[:, 1] - 1.0))[:2]]
    assert np.abs(at_one[:, 0] - known.delay_margin).min() < 2e-3
    if name == "sampled":
        first = min((one for one in found.curves), key=lambda one: one.x[0])
        assert first.y[0] == pytest.approx(known.gain_margin, rel=1e-9)
    for i, j in ((3, 4), (len(found.grid_x) // 2, len(found.grid_y) // 3)):
        tau, k = float(found.grid_x[i]), float(found.grid_y[j])
        roots = loop_roots(_louder(loop, k), "command", delays=[tau], delay_at=PORT).sets[0].roots
        assert found.counts[j, i] == np.sum(roots.real > 0), (tau, k)


def _louder(loop: object, factor: float) -> object:
    """The bench with its autopilot louder: the same as a factor on its command."""
    text = BENCHES["sampled" if loop.sampled else "continuous"]  # type: ignore[attr-defined]
    louder = f"{3 * factor}*(0 - angle) - {0.4 * factor}*rate"
    return build(parse_design(text.replace("3*(0 - angle) - 0.4*rate", louder)))


def test_a_loop_over_delay_and_a_number() -> None:
    loop = build(parse_design(BENCHES["continuous"]))
    found = loop_map(loop, "command", (0.0, 0.3), delay_at=PORT, number=(PARAMETER, (40.0, 200.0)))
    (first, *_) = sorted(found.curves, key=lambda one: one.x[0])
    for k in range(0, len(first.y), 20):
        there = with_numbers(loop, {PARAMETER: float(first.y[k])})
        margin = loop_margins(there, "command", [0.0], delay_at=PORT).margins[0]
        assert first.x[k] == pytest.approx(margin.delay_margin, rel=1e-8)
        assert first.frequency[k] == pytest.approx(margin.phase_margin_frequency, rel=1e-8)


def test_a_loop_over_delay_and_time() -> None:
    """A gain that drifts by 5 % a second: after t s the loop is that of 1 + 0.05 t times the command."""
    drift = '[[effects]]\ntype = "gain_drift"\nat = "autopilot.output"\nrate = 0.05\n'
    loop = build(parse_design(BENCHES["continuous"] + drift))
    found = loop_map(loop, "command", (0.0, 0.3), delay_at=PORT, number=("time", (0.0, 20.0)))
    assert found.names == ("delay", "time")
    (first, *_) = sorted(found.curves, key=lambda one: one.x[0])
    for k in range(0, len(first.y), 20):
        louder = _louder(build(parse_design(BENCHES["continuous"])), 1 + 0.05 * float(first.y[k]))
        margin = loop_margins(louder, "command", [0.0], delay_at=PORT).margins[0]  # type: ignore[arg-type]
        assert first.x[k] == pytest.approx(margin.delay_margin, rel=1e-8)
    assert first.x[0] != pytest.approx(first.x[-1], rel=0.05)


def test_rows_of_which_crossings_appear_are_halved() -> None:
    """A pair of crossings at ±√y about 1: a fold at y = 0."""
    asked: list[float] = []

    def row(y: float) -> Row:
        asked.append(y)
        if y <= 0:
            return Row(np.zeros(0), np.zeros(0), np.array([0]))
        return Row(np.array([1 - y**0.5, 1 + y**0.5]), np.array([3.0, 3.0]), np.array([0, 2, 0]))

    curves, rows = joined_rows(row, np.linspace(-1, 0.8, 10).tolist(), 2.0)
    assert len(curves) == 2 and len(rows) == 10 and len(asked) > 10
    assert all(np.allclose((one.x - 1) ** 2, one.y) for one in curves)
    assert min(float(one.y.min()) for one in curves) < 0.05
    left, right = sorted(curves, key=lambda one: one.x[-1])
    assert np.all(left.towards[:, 0] > 0) and np.all(right.towards[:, 0] < 0)


@pytest.mark.parametrize(
    "how", [{}, {"gains": (1.0, 2.0), "number": (PARAMETER, (1.0, 2.0))}, {"gains": (2.0, 1.0)}, {"gains": (0.0, 1.0)}]
)
def test_what_is_no_plane_is_refused(how: dict[str, object]) -> None:
    with pytest.raises(AnalysisError):
        loop_map(build(parse_design(BENCHES["continuous"])), "command", (0.0, 0.1), **how)  # type: ignore[arg-type]
