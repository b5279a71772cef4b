"""Fast paths of the search against the one simulation of the loop.

Exact, to 1e-9 of full scale: the response to a pulse convolved with a source, or with what an effect changes in its
wire; effects on held signals, and at exits, as array operations; the adjoint of a way; a stretch of a scale factor's
response at an exit for a transient there; the scaling of effects that are linear in their amplitude. A start of the
search only, with a known order of error: modes as a product of spectra, pulses through sampled blocks, transients with
dynamics behind them, directions of effects that are not linear.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import cont2discrete, fftconvolve, lfilter

from delaytools.blocks.block import specifications
from delaytools.design.build import build
from delaytools.design.catalogue import EFFECTS
from delaytools.design.design import parse_design
from delaytools.diagnosis.added import Added, with_added
from delaytools.diagnosis.case import Case, prepared_case
from delaytools.diagnosis.fitting import Fitted, fit_hypothesis
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.screen import Base, base_of, response
from delaytools.diagnosis.spectra import impulse
from delaytools.diagnosis.starts import LINEAR, Candidate, candidates
from delaytools.diagnosis.views import case_view
from delaytools.loop.port import find_port, ports
from delaytools.loop.segments import segments
from delaytools.signals.parameter import Parameter
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column, Multisine
from delaytools.simulation.simulate import simulate
from tests.diagnosis.small_cases import ACTUATOR, CHAIN, DRIVE, fitted, planted

Array = NDArray[np.float64]
EXACT = 1e-9  # of full scale
INPUT = Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=8.0, lines=20)
SAMPLED = """
[signals]
u = "deg"
x = "deg"
[blocks.computer]
type = "sample_hold"
input = "2*u"
output = "x"
period = "tick"
[parameters]
tick = "8 ms"
"""
BENCHES = {"actuator": (ACTUATOR, "x"), "chain": (CHAIN, "y"), "drive": (DRIVE, "v")}
BENT = ("coulomb_friction", "load_dependent_friction", "cubic_damping", "quadratic_drag", "cubic_stiffness")


def bench(name: str, *, frame: str = "1 ms", substeps: int | None = None) -> Base:
    """A bench fitted to a log without any effect."""
    text, exit = BENCHES[name]
    case = planted(f'frame = "{frame}"\n{text}', (), INPUT, exit=exit, seconds=2.0)
    case = replace(case, substeps=substeps, _replays={})
    return base_of(case, fitted(case))


def change(base: Base, one: Added) -> Array:
    """(n, exits): what an effect changes, by the one simulation."""
    case, added = base.case, (*base.fitted.added, one)
    return case.outputs(added, tuple(p.value for p in case.parameters(added)))[0] - base.outputs[0]


def full_scale(case: Case) -> float:
    return float(np.abs(case.measured[0]).max())


def apart(base: Base, fast: Array, slow: Array) -> float:
    """The largest difference, of full scale."""
    return float(np.abs(fast - slow).max()) / full_scale(base.case)


def from_zero(base: Base) -> tuple[Base, Array]:
    """The bench with a column that begins at 0 and moves quickly, and that column."""
    record = base.case.records[0]
    column = np.cumsum(np.random.default_rng(5).standard_normal(len(record))) * 0.05
    column[0] = 0.0
    case = replace(base.case, records=(replace(record, columns={**record.columns, "w": column}),), _replays={})
    return replace(base, case=case), column


def quick(base: Base, one: Added) -> Array:
    """(n, exits): the same by what the effect changes in its wire."""
    found = base.moved_by(one)
    assert found is not None
    return found[0]


def held_bench(*there: Added) -> Base:
    """An actuator that is driven by a staircase from rest, with effects in its wire already."""
    time = np.arange(2001) * 1e-3
    rows = 3 * np.sin(5 * np.floor(time / 0.005 + 1e-9) * 0.005) * (time > 0.003)
    loop = build(parse_design(ACTUATOR))
    record = simulate(with_added(loop, there), {"u": Column(time=time, values=rows, held=True)}, duration=2.0).record
    log = Record(time, {"u": rows, "x": record["x"][: len(time)]}, {}, frozenset({"u"}))
    case = prepared_case(segments(loop, {"u", "x"})[0], (log,), (), frozenset({"u"}))
    case = case.whitened_by(noise_of(case, Fitted((), (), np.zeros(0), np.zeros((0, 0))), Carried({})))
    return base_of(case, fitted(case, *there))


# --- exact ---


HELD = {
    "dead_band": {"half_width": 0.7},
    "backlash": {"half_width": 0.4},
    "saturation": {"limit": 2.0},
    "quantization": {"step": 0.3},
    "scale_factor": {"factor": 1.2},
    "delay": {"delay": 0.017},
    "sample_hold": {"period": 0.02},
    "transient_gain": {"factor": 0.5, "start": 0.5, "end": 0.9},
}


@pytest.mark.parametrize("kind", HELD)
def test_an_effect_on_a_held_signal_is_what_it_changes_convolved(kind: str) -> None:
    base = held_bench()
    one = Added(kind, "act.input", HELD[kind])
    way = base.way("act.input")
    assert way is not None and way.is_quick
    assert np.abs(change(base, one)).max() > 0.01
    assert apart(base, quick(base, one), change(base, one)) < EXACT


@pytest.mark.parametrize("name", BENCHES)
def test_a_change_convolved_is_the_change_put_in(name: str) -> None:
    base = bench(name)
    rows = np.cumsum(np.random.default_rng(7).standard_normal(len(base.case.records[0]))) * 0.05 + 1.0
    for element in base.case.segment.loop.elements:
        way = base.way(f"{element.name}.{next(iter(element.inputs))}")
        assert way is not None
        fast = way.convolved((rows,))
        assert fast is not None
        assert apart(base, fast[0], way.simulated((rows,))[0]) < EXACT


@pytest.mark.parametrize("name", BENCHES)
def test_weights_are_the_adjoint_of_the_way(name: str) -> None:
    base = bench(name)
    generator = np.random.default_rng(8)
    rows, residual = (generator.standard_normal(len(base.case.records[0])) for _ in range(2))
    rows[0] = 0.0
    way = base.way(f"{base.case.segment.blocks[0]}.{next(iter(base.case.segment.loop.elements[0].inputs))}")
    assert way is not None
    moved = way.convolved((rows,))
    assert moved is not None
    ahead, back = float(base.case.whitened(moved) @ residual), float(way.weights(residual)[0] @ rows)
    assert abs(ahead - back) < EXACT * np.linalg.norm(base.case.whitened(moved)) * np.linalg.norm(residual)


def test_a_way_through_friction_is_not_convolved() -> None:
    rough = Added("coulomb_friction", "drive.v'", {"level": 0.3, "smoothing": 0.05})
    case = planted(DRIVE, (rough,), INPUT, exit="v", seconds=2.0)
    way = base_of(case, fitted(case, rough)).way("drive.u")
    assert way is not None and not way.is_quick
    assert way.convolved((np.ones(len(case.records[0])),)) is None


@pytest.mark.parametrize("substeps", [None, 3])
@pytest.mark.parametrize("name", BENCHES)
def test_a_pulse_convolved_with_a_source_is_the_coupling_of_that_source(name: str, substeps: int | None) -> None:
    base, column = from_zero(bench(name, substeps=substeps))
    loop = base.case.segment.loop
    for port in (p for e in loop.elements for p in ports(e) if p.kind != "rate"):
        pulse = impulse(base, port)
        assert pulse is not None
        slow = change(base, Added("cross_coupling", str(port), {"gain": 0.3}, {"source": "w"}))
        fast = 0.3 * fftconvolve(column[:, None], pulse, axes=0)[: len(column)]
        assert np.abs(slow).max() > 0 and apart(base, fast, slow) < EXACT, port


def test_a_pulse_counts_from_the_fitted_hypothesis() -> None:
    """Substeps: a step split where the delayed signal first arrives shows the integration's own error, here 1.3e-9."""
    late = Added("delay", "act.input", {"delay": 0.0123})
    case = planted(ACTUATOR, (late,), INPUT, seconds=2.0)
    case = replace(case, substeps=3, _replays={})
    base, column = from_zero(base_of(case, fitted(case, late)))
    pulse = impulse(base, find_port(case.segment.loop, "act.input"))
    assert pulse is not None
    values = tuple(p.value for p in base.fitted.parameters)
    coupled = (*base.fitted.added, Added("cross_coupling", "act.input", {"gain": 1.0}, {"source": "w"}))
    slow = base.case.outputs(coupled, (*values, 1.0))[0] - base.outputs[0]
    assert apart(base, fftconvolve(column[:, None], pulse, axes=0)[: len(column)], slow) < EXACT


@pytest.mark.parametrize("name", BENCHES)
@pytest.mark.parametrize("part", [0.003, 0.1, 0.7])
def test_a_quantiser_at_an_exit_is_rounding(name: str, part: float) -> None:
    base = bench(name)
    spot = next(s for s in spots(base.case.segment) if s.kind == "quantization" and _at_exit(base, str(s.port)))
    one = Added("quantization", str(spot.port), {"step": part * full_scale(base.case)})
    assert apart(base, quick(base, one), change(base, one)) < EXACT


def _at_exit(base: Base, port: str) -> bool:
    block, _, name = port.partition(".")
    return base.case.segment.loop[block].outputs.get(name) in base.case.exits


@pytest.mark.parametrize("edges", [(0.5, 1.2), (0.0, 0.031), (1.5, 2.5)])
def test_a_transient_at_an_exit_is_a_stretch_of_a_scale_factor(edges: tuple[float, float]) -> None:
    base = bench("actuator")
    whole = change(base, Added("scale_factor", "act.output", {"factor": 1.02}))
    values = {"factor": 1.4, "start": edges[0], "end": edges[1]}
    inside = (base.case.rows.time >= edges[0] - 1e-9) & (base.case.rows.time < edges[1] - 1e-9)
    fast = 0.4 / 0.02 * whole * inside[:, None]
    assert apart(base, fast, change(base, Added("transient_gain", "act.output", values))) < EXACT


@pytest.mark.parametrize("name", BENCHES)
def test_effects_linear_in_their_amplitude_scale(name: str) -> None:
    base = bench(name)
    for one in directions(base):
        if one.first.kind not in BENT:
            small, large = response_at(base, one, 1.0), response_at(base, one, 40.0)
            assert apart(base, 40 * small, large) < EXACT, one.first.name


def directions(base: Base) -> list[Candidate]:
    view = case_view(base.case, base.fitted)
    found = [c for c in candidates(view, spots(base.case.segment)) if c.manner == LINEAR]
    assert found
    return found


def response_at(base: Base, one: Candidate, factor: float) -> Array:
    """What the effect changes at a multiple of its first amplitude."""
    neutral = specifications(EFFECTS[one.first.kind])[one.amplitude].neutral or 0.0
    start = one.first.values[one.amplitude]
    return change(base, one.first.moved({one.amplitude: neutral + factor * (start - neutral)}))


# --- starts only: the order of their error ---


@pytest.mark.parametrize("kind", ["dead_band", "backlash", "scale_factor"])
def test_behind_a_delay_between_rows_a_change_is_up_to_a_row_late(kind: str) -> None:
    base = held_bench(Added("delay", "act.input", {"delay": 0.0044}))
    one = Added(kind, "act.input", HELD[kind])
    assert apart(base, quick(base, one), change(base, one)) < 0.02


@pytest.mark.parametrize("name", BENCHES)
def test_the_direction_of_a_bent_effect_is_right_to_first_order(name: str) -> None:
    base = bench(name)
    for one in (c for c in directions(base) if c.first.kind in BENT):
        small = response_at(base, one, 1e-2)
        errors = [apart(base, f * 100 * small, response_at(base, one, f)) for f in (0.5, 1.0)]
        assert errors[1] < 0.1 * np.abs(response_at(base, one, 1.0)).max() / full_scale(base.case), one.first.name
        assert 2.5 < errors[1] / errors[0] < 6.0, (one.first.name, errors)


@pytest.mark.parametrize("port", ["act.input", "act.output", "sensor.input"])
def test_a_transient_with_dynamics_behind_it_is_right_away_from_its_edges(port: str) -> None:
    base = bench("chain")
    whole = change(base, Added("scale_factor", port, {"factor": 1.02}))
    slow = change(base, Added("transient_gain", port, {"factor": 1.4, "start": 0.5, "end": 1.2}))
    time = base.case.rows.time
    off = np.abs(0.4 / 0.02 * whole * ((time >= 0.5) & (time < 1.2))[:, None] - slow)[:, 0] / full_scale(base.case)
    assert off.max() > 1e-2
    for edge, decay in ((edge, 30.0) for edge in (0.5, 1.2)):  # 1/s: less than the actuator's 36
        later = time[(time > edge) & (time < edge + 0.6)] - edge
        here = off[(time > edge) & (time < edge + 0.6)]
        assert np.all(here < 3 * off.max() * np.exp(-decay * later) + EXACT), port
    assert off[time < 0.5].max() < EXACT


def test_a_mode_as_a_product_of_spectra_is_right_to_second_order_in_the_row() -> None:
    errors = []
    for frame in ("2 ms", "1 ms"):
        base = bench("actuator", frame=frame)
        slow = change(base, Added("flexible_mode", "act.input", MODE, {"source": "u"}))
        pulse = impulse(base, find_port(base.case.segment.loop, "act.input"))
        assert pulse is not None
        shaken = _mode(base.case.records[0]["u"], base.case.step)
        fast = fftconvolve(shaken[:, None], pulse, axes=0)[: len(shaken)]
        errors.append(apart(base, fast, slow))
    assert errors[1] < 1e-3 and 3.5 < errors[0] / errors[1] < 4.5, errors


def test_a_mode_where_it_is_measured_is_what_shakes_it_through_its_own_answer() -> None:
    for whole in (bench("actuator"), held_bench()):
        case = replace(whole.case, substeps=16, _replays={})  # so that the run's own steps do not count
        base = base_of(case, fitted(case))
        one = Added("flexible_mode", "act.output", MODE, {"source": "u"})
        slow = change(base, one)
        assert np.abs(slow).max() > 0.1 and apart(base, quick(base, one), slow) < EXACT


def test_a_mode_in_a_wire_is_right_to_second_order_in_the_row() -> None:
    errors = []
    for frame in ("2 ms", "1 ms"):
        base = bench("actuator", frame=frame)
        one = Added("flexible_mode", "act.input", MODE, {"source": "u"})
        errors.append(apart(base, quick(base, one), change(base, one)))
    assert errors[1] < 1e-3 and 3.5 < errors[0] / errors[1] < 4.5, errors


MODE = {"gain": 0.3, "frequency": 12.0, "damping": 0.05}


def _mode(rows: Array, step: float) -> Array:
    """gain·ω s/(s² + 2ζω s + ω²) of straight lines between rows, at the rows."""
    w = 2 * np.pi * MODE["frequency"]
    top, bottom = [MODE["gain"] * w, 0.0], [1.0, 2 * MODE["damping"] * w, w * w]
    numerator, denominator, _ = cont2discrete((top, bottom), step, method="foh")
    return np.asarray(lfilter(numerator.ravel(), denominator, rows))


def test_a_pulse_through_a_sampled_block_is_its_mean_over_a_period() -> None:
    case = planted(SAMPLED, (), INPUT, seconds=2.0, noise=0.0)
    base, _ = from_zero(base_of(case, fitted(case)))
    pulse = impulse(base, find_port(case.segment.loop, "computer.input"))
    assert pulse is not None and pulse[:, 0].sum() == pytest.approx(1.0) and np.all(np.abs(pulse[8:]) < EXACT)
    column = np.sin(2 * np.pi * 1.5 * base.case.rows.time)
    records = (replace(case.records[0], columns={**case.records[0].columns, "w": column}),)
    base = replace(base, case=replace(case, records=records, _replays={}))
    slow = change(base, Added("cross_coupling", "computer.input", {"gain": 1.0}, {"source": "w"}))
    fast = fftconvolve(column[:, None], pulse, axes=0)[: len(column)]
    assert 0 < np.abs(fast - slow).max() < 0.55 * 2 * np.pi * 1.5 * 0.008  # what a sine does in half a period


@pytest.mark.parametrize("tick", ["2 ms", "8 ms", "3.5 ms"])
@pytest.mark.parametrize("port", ["computer.input", "computer.output"])
def test_a_way_through_a_computer_slower_than_the_rows(port: str, tick: str) -> None:
    """Only ticks count, and a change between them is not taken for one that does nothing."""
    case = planted(SAMPLED.replace("8 ms", tick), (), INPUT, seconds=2.0)
    base = base_of(case, fitted(case))
    way = base.way(port)
    assert way is not None and way.is_quick == (port == "computer.output" or tick != "3.5 ms")
    rows = np.cumsum(np.random.default_rng(9).standard_normal(len(base.case.records[0]))) * 0.05 + 1.0
    slow = way.simulated((rows,))[0]
    assert np.abs(slow).max() > 0.1 * full_scale(base.case)
    assert apart(base, way.moved((rows,))[0], slow) < EXACT


def test_what_a_bound_stops_is_not_taken_to_imitate_an_effect() -> None:
    """A lag beside a tolerance that would imitate it, but is too narrow: what is left speaks for the lag."""
    case = planted(ACTUATOR, (Added("lag", "act.input", {"time_constant": 0.006}),), INPUT, seconds=4.0)
    slower = Parameter("act.natural_frequency", 60.0, low=59.0, high=61.0)
    case = replace(case, tolerated=(slower,), _replays={})
    base = base_of(case, fit_hypothesis(case, ()))
    assert base.fitted.parameters[0].at_boundary
    change = response(base, Added("lag", "act.input", {"time_constant": 0.006}))
    assert change is not None and base.gain(change)[0] > 0.5 * base.fitted.chi2
