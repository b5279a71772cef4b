"""The truth simulator against closed forms and unrelated integrations. Errors are shares of full scale."""

from collections.abc import Callable, Mapping
from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.truth import closed_forms as exact
from tests.truth.closed_forms import ms
from tests.truth.integrators import Integrator, collocation, dop853
from tests.truth.method_of_steps import Delay, Input, Sampler, System, simulate
from tests.truth.problems import PROBLEMS, constant, dead_band, reference, solve

Array = NDArray[np.float64]
LIMIT = 1e-11
BOTH = pytest.mark.parametrize("integrator", [dop853, collocation])


def error(found: Mapping[str, Array], wanted: Mapping[str, Array], every: int = 1) -> float:
    """Largest difference over the columns of `wanted`, as a share of each column's full scale."""
    return max(
        float(np.abs(found[name][::every][: len(column)] - column).max() / np.abs(column).max())
        for name, column in wanted.items()
    )


def show(what: str, size: float, limit: float = LIMIT) -> None:
    """Print the error and hold it to the limit."""
    print(f"{what}: {size:.1e} of full scale")
    assert size < limit


def later(delay: str) -> Callable[[Fraction], Fraction]:
    """Arrival of a tick behind a constant delay in ms."""
    return lambda tick: tick + ms(delay)


ROLL_CASES: dict[str, Callable[[], dict[str, Array]]] = {
    "roll": lambda: exact.exact_roll(),
    "roll, table delay 15 ms": lambda: exact.exact_roll(table_delay=ms("15")),
    "roll, table delay 12.3 ms": lambda: exact.exact_roll(table_delay=ms("12.3")),
    "roll, table delay 0.4 ms": lambda: exact.exact_roll(table_delay=ms("0.4")),
    "roll, command delay 3 ms": lambda: exact.exact_roll(arrival=later("3")),
    "roll, command delay 7.3 ms": lambda: exact.exact_roll(arrival=later("7.3")),
    "roll, command delay 5 ms": lambda: exact.exact_roll(arrival=later("5")),
    "roll, command delay 0.4 ms": lambda: exact.exact_roll(arrival=later("0.4")),
    "roll, command delay varying": lambda: exact.exact_roll(arrival=exact.late_arrival),
    "roll, dead band": lambda: exact.exact_roll(table_delay=ms("15"), shape=lambda u: dead_band(u, 0.3)),
    "roll, saturation": lambda: exact.exact_roll(table_delay=ms("15"), shape=lambda u: np.clip(u, -0.5, 0.5)),
    "roll, rate sampled at 2 ms": lambda: exact.exact_roll(rate_period=ms("2")),
    "roll, rate sampled at 3.3 ms": lambda: exact.exact_roll(rate_period=ms("3.3")),
}


@pytest.mark.parametrize("name", ROLL_CASES)
def test_roll_bench_agrees_with_matrix_exponentials(name: str) -> None:
    """Every column and every row, jumps included."""
    show(name, error(reference(name), ROLL_CASES[name]()))


def test_roll_bench_agrees_where_the_table_delay_varies() -> None:
    """Variation of constants and quadrature, at the ticks."""
    show("varying table delay", error(reference("roll, table delay varying"), exact.varying_table(), every=5))


@pytest.mark.parametrize("name", PROBLEMS)
def test_two_integrators_agree(name: str) -> None:
    """The references (collocation) against DOP853."""
    wanted = {k: v for k, v in solve(name, dop853).items() if k != "time"}
    show(f"{name}, DOP853", error(reference(name), wanted))


@BOTH
def test_delayed_integrator_is_the_published_polynomial(integrator: Integrator) -> None:
    """ControlSystems.jl, test_delay_timeresp.jl."""
    found = solve("delayed integrator", integrator)
    t = found["time"]
    wanted = np.where(t < 1, 0, 2 * (t - 1)) - np.where(t < 2, 0, 2 * (t - 2) ** 2)
    show("delayed integrator", error(found, {"y": wanted}), 1e-12)


def test_resonance_loop_gives_the_published_value() -> None:
    """Counted from the first moment the output can move, 20 ms; the published figure is good to 6e-11."""
    found = reference("resonance loop")
    assert not found["y"][:21].any()
    value = found["y"][1020]
    print(f"resonance loop: y(1 s) = {value:.15f}")
    assert abs(value - 0.749927348677233) < 1e-10


def test_resonance_loop_agrees_with_stacked_intervals() -> None:
    """One linear system without delay holds all 55 intervals."""
    y = exact.stacked_loop(exact.resonance_plant(), (np.zeros((1, 1)), np.ones(1)), 20, 55)
    show("resonance loop, stacked", error(reference("resonance loop"), {"y": y}))


def test_rate_loop_agrees_with_stacked_intervals() -> None:
    """One linear system without delay holds 66 intervals of 15 ms."""
    w = 6 * np.pi
    sine = (np.array([[0, w], [-w, 0]]), np.array([0.0, 1.0]))
    y = exact.stacked_loop(exact.rate_loop_plant(), sine, 15, 66)
    show("rate loop 15 ms, stacked", error(reference("rate loop, 15 ms"), {"y": y}))


@pytest.mark.parametrize(("name", "tau"), [("rate loop, 15 ms", "0.015"), ("rate loop, 0.3 ms", "0.0003")])
def test_rate_loop_agrees_with_the_inverse_laplace_transform(name: str, tau: str) -> None:
    """At three early instants, while the transient lives."""
    y, scale = reference(name)["y"], np.abs(reference(name)["y"]).max()
    for row in (40, 103, 250):
        wanted = exact.rate_loop_inverse(tau, row / 1000)
        show(f"{name}, inverse transform at {row} ms", abs(y[row] - wanted) / scale)


def test_rate_loop_ends_in_its_steady_oscillation() -> None:
    """0.3 ms: T(j w) sin(w t) once the transient (e^-40) is gone."""
    a, b, c = exact.rate_loop_plant()
    s = 6j * np.pi
    loop = c @ np.linalg.solve(s * np.eye(5) - a, b) * np.exp(-0.0003 * s)
    t = np.arange(900, 1001) * 1e-3
    y = reference("rate loop, 0.3 ms")["y"][900:]
    show("rate loop 0.3 ms, steady", error({"y": y}, {"y": np.imag(loop / (1 + loop) * np.exp(s * t))}))


def test_turntable_agrees_with_radau() -> None:
    """An implicit method of another family, in a loop of its own; 0.4 s (stick and slip at the start)."""
    found = {k: v[:401] for k, v in reference("turntable").items()}
    show("turntable, Radau", error(found, exact.turntable_by_radau(200), every=2), 1e-10)


def clock() -> Sampler:
    """A counter: 1, 2, 3, ... at 0, 2 ms, 4 ms, ..."""
    return Sampler("n", 2e-3, lambda s: s["n"] + 1)


@BOTH
def test_a_held_signal_keeps_its_jumps_and_is_seen_at_its_arrival(integrator: Integrator) -> None:
    """Delays of 3 and 3 + 1.5 ms of a counter; a sampler reading at the instant of arrival; an integral."""
    system = System(
        states={"area": 0.0},
        rates=lambda s: (s["later"],),
        samplers=(clock(), Sampler("seen", 1e-3, lambda s: s["late"])),
        delays={
            "late": Delay("n", constant(3e-3), held=True),
            "later": Delay("late", constant(1.5e-3), held=True),
        },
    )
    found = simulate(system, 0.012, ("n", "late", "later", "seen", "area"), integrator=integrator)
    assert found["n"].tolist() == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7]
    assert found["late"].tolist() == [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    assert found["seen"].tolist() == found["late"].tolist()
    assert found["later"].tolist() == [0, 0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    wanted = np.array([0, 0, 0, 0, 0, 0.5, 1.5, 3, 5, 7.5, 10.5, 14, 18]) * 1e-3
    show("area under a delayed staircase", error(found, {"area": wanted}), 1e-14)


@BOTH
def test_downstream_samplers_see_new_values_at_the_same_instant(integrator: Integrator) -> None:
    """In the order listed; a memory listed behind its reader is one update old."""
    system = System(
        states={"x": 0.0},
        rates=lambda s: (0.0,),
        samplers=(clock(), Sampler("twice", 4e-3, lambda s: 2 * s["n"]),
                  Sampler("step", 2e-3, lambda s: s["n"] - s["old"]), Sampler("old", 2e-3, lambda s: s["n"])),
    )
    found = simulate(system, 0.006, ("twice", "step", "old"), integrator=integrator)
    assert found["twice"].tolist() == [2, 2, 2, 2, 6, 6, 6]
    assert found["step"].tolist() == [1] * 7
    assert found["old"].tolist() == [1, 1, 2, 2, 3, 3, 4]


@BOTH
def test_two_delays_in_a_row_are_their_sum(integrator: Integrator) -> None:
    """y' = -30 y(t - 0.7 ms - 12.3 ms) + r, r a step at 3.1 ms, against one delay of 13 ms."""
    def system(split: bool) -> System:
        last = Delay("first" if split else "y", constant(0.0123 if split else 0.013))
        first = {"first": Delay("y", constant(0.0007))} if split else {}
        return System(
            states={"y": 0.0},
            rates=lambda s: (-30 * s["last"] + s["r"],),
            inputs={"r": Input((lambda t: 0.0, lambda t: 1.0), (0.0031,))},
            delays={**first, "last": last},
        )

    split, whole = (simulate(system(s), 0.1, ("y", "last"), integrator=integrator) for s in (True, False))
    show("two delays in a row", error(split, {k: whole[k] for k in ("y", "last")}))
    t = whole["time"][:30] - 0.0031
    ramp, bend = np.maximum(t, 0), np.maximum(t - 0.013, 0)
    show("first pieces of it", error(whole, {"y": ramp - 15 * bend**2 + 150 * np.maximum(t - 0.026, 0) ** 3}))


def test_a_kink_that_is_no_breakpoint_is_refused() -> None:
    """A dead band on a state switches where no event is."""
    system = System({"x": -1.0}, lambda s: (1.0 + np.maximum(s["x"] + 0.7123, 0),))
    with pytest.raises(ArithmeticError, match="breakpoint is missing"):
        simulate(system, 1.0, ("x",))


def test_an_unknown_signal_is_named() -> None:
    """A formula that reads what is not there."""
    with pytest.raises(KeyError, match="nowhere"):
        simulate(System({"x": 0.0}, lambda s: (s["nowhere"],)), 0.01, ("x",))
