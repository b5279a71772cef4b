"""The truth of the blind benchmark: lanes, step halving, exact answers, and the judge."""

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_effects.architecture import Architecture
from benchmarks.hidden_effects.cases import architecture_of, draw
from benchmarks.hidden_effects.excitation import demand
from benchmarks.hidden_effects.kinds import MIX, kind_of
from benchmarks.hidden_effects.memory_effects import _slewed
from benchmarks.hidden_effects.pitch import PITCH
from benchmarks.hidden_effects.practice import KNOWN, expected, residuals
from benchmarks.hidden_effects.records import Lane, Planted
from benchmarks.hidden_effects.roll import ROLL
from benchmarks.hidden_effects.score import judge, table
from benchmarks.hidden_effects.servo import SERVO
from benchmarks.hidden_effects.simulator import simulate

PRACTICE = Path(__file__).resolve().parents[3] / "shared" / "practice"
ROWS = 300
BENCHES = {bench.name: bench for bench in (ROLL, SERVO, PITCH)}


def _lane(bench: Architecture, *effects: Planted, parent: int | None = None) -> Lane:
    values = {name: x for name, (x, _) in bench.numbers.items()}
    main, other = bench.externals
    rng = np.random.default_rng(5)
    t = np.arange(ROWS) * 1e-3
    externals = {main: demand("noise", bench.demand_size[1], 20000, rng)[:ROWS], other: 20 * np.sin(9 * t)}
    return Lane(values, effects, externals, parent=parent)


def _plant(effect: str, port: str, source: str | None = None, **numbers: float) -> Planted:
    return Planted(effect, port, numbers, ("",), source)


def _some_effects(bench: Architecture) -> list[tuple[Planted, ...]]:
    first = bench.chain[0]
    entry = f"{first.name}.{first.input_port}"
    force = next(iter(first.force_ports))
    return [
        (),
        (_plant("dead_band", entry, half_width=0.05), _plant("delay", entry, delay=0.00333)),
        (_plant("coulomb_friction", force, level=60.0), _plant("cubic_stiffness", force, coefficient=-3.0)),
        (_plant("variable_delay", entry, mean=0.006, amplitude=0.003, frequency=3.0, phase=0.4),),
        (
            _plant("backlash", entry, half_width=0.1),
            _plant("bias", f"{first.name}.{first.outputs[0].port}", level=0.1),
        ),
        (_plant("cross_coupling", force, source=bench.externals[1], gain=2.0),),
    ]


@pytest.mark.parametrize("y", [-1.0, 0.02, 0.3, 2.0])
@pytest.mark.parametrize("ends", [(0.3, 0.3), (0.3, 0.4), (0.3, 0.1), (-0.2, 0.5)])
def test_the_mean_of_a_slew_is_that_of_many_small_steps(y: float, ends: tuple[float, float]) -> None:
    limit, elapsed, many = 2.0, 0.1, 200_000
    follows, found = y, 0.0
    for k in range(many):
        target = ends[0] + (ends[1] - ends[0]) * (k + 0.5) / many
        follows += np.clip(target - follows, -limit * elapsed / many, limit * elapsed / many)
        found += follows / many
    whole = tuple(np.array([end]) for end in ends)
    assert _slewed(np.array([y]), whole, elapsed, np.array([limit]))[0] == pytest.approx(found, abs=1e-5)


def test_a_slew_limit_on_a_staircase_needs_no_fine_steps() -> None:
    slow = (_plant("rate_limit", "drive.u", limit=300.0),)
    coarse, fine = (simulate(SERVO, [_lane(SERVO, *slow)], ROWS, steps) for steps in (10, 80))
    for name in coarse:
        assert np.abs(coarse[name] - fine[name]).max() < 1e-5 * np.abs(fine[name]).max()


@pytest.mark.parametrize("name", BENCHES)
def test_many_lanes_are_single_lanes(name: str) -> None:
    bench = BENCHES[name]
    sets = _some_effects(bench)
    together = simulate(bench, [_lane(bench, *effects) for effects in sets], ROWS, 4)
    for i, effects in enumerate(sets):
        alone = simulate(bench, [_lane(bench, *effects)], ROWS, 4)
        for signal, log in alone.items():
            np.testing.assert_allclose(together[signal][:, i], log[:, 0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", BENCHES)
def test_halving_the_step_changes_little(name: str) -> None:
    bench = BENCHES[name]
    lanes = [_lane(bench, *effects) for effects in _some_effects(bench)]
    usual, finer = simulate(bench, lanes, ROWS, 10), simulate(bench, lanes, ROWS, 20)
    for signal, log in usual.items():
        size = np.abs(log).max(axis=0)
        assert (np.abs(log - finer[signal]).max(axis=0) < 2e-4 * size + 1e-6).all(), signal


def test_a_shadow_without_effect_differs_by_the_effect_alone() -> None:
    lanes = [_lane(ROLL, _plant("bias", "actuator.output", level=0.2)), _lane(ROLL, parent=0)]
    logs = simulate(ROLL, lanes, ROWS, 2)
    np.testing.assert_allclose(logs["fin_position"][:, 0] - logs["fin_position"][:, 1], 0.2, atol=1e-9)
    np.testing.assert_allclose(logs["sensed_rate"][:, 0], logs["sensed_rate"][:, 1], atol=1e-9)


def test_held_jump_arrives_between_two_fine_steps() -> None:
    """A step through a delay of 3.25 fine steps into the drive: the answer of the differential equation."""
    values = {"kp": 1.0, "kd": 0.0, "drive.gain": 400.0, "drive.viscous": 8.0}
    one = {"reference": np.ones(ROWS), "base_rate": np.zeros(ROWS)}
    late = 0.000325
    lane = Lane(values, [_plant("delay", "drive.u", delay=late)], one)
    rate = simulate(SERVO, [lane], 3)["rate"][:, 0]
    t = np.arange(3) * 1e-3
    exact = np.where(t > late, 50 * (1 - np.exp(-8 * (t - late))), 0.0)
    np.testing.assert_allclose(rate, exact, atol=2e-6)


def test_cases_are_drawn_alike_every_time() -> None:
    kinds = [kind_of(n, 3)[0] for n in range(1, 321)]
    assert {kind: kinds.count(kind) for kind in MIX} == MIX
    assert all(architecture_of(n, 3).name in BENCHES for n in range(1, 321))
    first, again = draw(7, 3, 0), draw(7, 3, 0)
    assert first.truth == again.truth
    assert all((first.externals[k] == again.externals[k]).all() for k in first.externals)


def _diagnosis(verdict: str, *missing: dict) -> dict:
    return {"verdict": verdict, "missing": list(missing), "confusable": [], "seconds": 1.0}


def _said(effect: str, signal: str, **numbers: tuple[float, float]) -> dict:
    values = {k: {"value": v, "std": s, "unit": ""} for k, (v, s) in numbers.items()}
    return {"effect": effect, "at": "x", "signal": signal, "parameters": values}


def test_the_judge_keeps_the_rules() -> None:
    truth = [{"effect": "delay", "signal": "rate", "parameters": {"delay": 0.010}}]
    near, far = _said("delay", "rate", delay=(0.0104, 0.0)), _said("delay", "rate", delay=(0.0120, 0.0001))
    unsure = _said("delay", "rate", delay=(0.0120, 0.001))
    assert judge(truth, _diagnosis("missing", near)).right
    assert judge(truth, _diagnosis("missing", unsure)).right
    assert not judge(truth, _diagnosis("missing", far)).right
    assert judge(truth, _diagnosis("missing", far)).named
    assert not judge(truth, _diagnosis("missing", near, near)).named
    assert not judge(truth, _diagnosis("missing", _said("lag", "rate", time_constant=(0.01, 0.0)))).named
    assert judge([], _diagnosis("adequate")).right
    assert judge([{"effect": "unknown", "signal": "rate", "parameters": {}}], _diagnosis("unexplained")).right
    wave = [{"effect": "periodic_interference", "signal": "rate", "parameters": {"phase": math.pi - 0.01}}]
    around = _said("periodic_interference", "rate", phase=(-math.pi + 0.02, 0.001))
    verdict = judge(wave, _diagnosis("missing", around))
    assert verdict.right and "practice" in table([verdict])


@pytest.mark.practice
@pytest.mark.skipif(not PRACTICE.exists(), reason="no practice benches beside the project")
@pytest.mark.parametrize("case", ["p05", "p09"])
def test_practice_logs_leave_only_noise(case: str) -> None:
    bench, _ = KNOWN[case]
    for signal, rest in residuals(PRACTICE, case, 4000).items():
        noise = expected(bench, signal)
        assert np.std(rest) < (1.25 * noise if noise else 1e-5), signal
