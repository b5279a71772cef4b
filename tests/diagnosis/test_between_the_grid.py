"""What stands between the points of a screen's grid, or far below its first: fine steps, narrow bands, light modes."""

import numpy as np
import pytest

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.quantisers import _fine_steps, _rounding, quantisations
from delaytools.diagnosis.screen import base_of, response, screened
from delaytools.diagnosis.spectra import modes
from delaytools.diagnosis.starts import candidates
from delaytools.diagnosis.swings import swings
from delaytools.signals.stimulus import Column, Multisine
from tests.diagnosis.small_cases import ACTUATOR, SLIDE, fitted, planted

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)
TIME = np.arange(0.0, 12.0005, 1e-3)
COMMAND = Column(time=TIME, values=WAVE.value(TIME), held=True)


@pytest.mark.parametrize(("step", "noise"), [(0.0213, 0.03), (0.0213, 0.15), (0.0467, 0.1)])
def test_a_step_far_finer_than_the_signal_is_found_behind_noise(step: float, noise: float) -> None:
    """noise: of the step; at 0.15 the rounding that gets through the actuator adds 6 % to it."""
    quantiser = Added("quantization", "act.input", {"step": step}, {}, frozenset({"step"}))
    case = planted(ACTUATOR, (quantiser,), COMMAND, noise=noise * step)
    base = base_of(case, fitted(case))
    found = {str(one.added.at): one for one in quantisations(base, base.view, spots(case.segment))}
    assert found["act.input"].added.values["step"] == pytest.approx(step, rel=1e-3)


def test_all_steps_at_once_are_as_each_alone() -> None:
    generator = np.random.default_rng(5)
    u, weights = WAVE.value(TIME), generator.standard_normal(len(TIME))
    weights += 0.5 * _rounding(u, 0.031) / 0.031
    best = _fine_steps(((u,), (weights,)), (0.01, 0.1), 40)
    along = np.array([float(_rounding(u, step) @ weights) / step for step in best])
    others = [float(_rounding(u, step) @ weights) / step for step in np.geomspace(0.01, 0.1, 40)]
    assert best[0] == pytest.approx(0.031, rel=1e-3)
    assert along[0] == along.max() and np.median(along) > np.median(others) + 2 * np.std(others)


def test_a_band_far_below_the_first_of_the_grid_is_found() -> None:
    band = Added("dead_band", "act.input", {"half_width": 2e-4})
    case = planted(ACTUATOR, (band,), COMMAND, noise=1e-5)
    base = base_of(case, fitted(case))
    best = screened(base, candidates(base.view, spots(case.segment)))[0]
    assert best.added.kind == "dead_band" and best.added.values["half_width"] == pytest.approx(2e-4, rel=0.1)
    assert best.gain > 0.9 * base.residual @ base.residual - len(base.residual)


def test_a_light_mode_promises_nearly_what_the_true_one_takes_off() -> None:
    values = {"gain": 0.02, "frequency": 21.43, "damping": 0.0061}
    mode = Added("flexible_mode", "act.output", values, {"source": "u"})
    case = planted(ACTUATOR, (mode,), COMMAND)
    base = base_of(case, fitted(case))
    best = max(modes(base, base.view, spots(case.segment)), key=lambda one: one.gain)
    change = response(base, mode)
    assert best.added.values["frequency"] == pytest.approx(21.43, rel=3e-3)
    assert change is not None and best.gain > 0.97 * base.gain(change)[0]


def test_a_swing_that_an_integrating_drive_hides_in_slow_drift_is_found() -> None:
    swing = {"mean": 2e-3, "amplitude": 9e-4, "frequency": 2.93, "phase": 1.5}
    case = planted(SLIDE, (Added("variable_delay", "drive.u", swing),), COMMAND, noise=1e-6, seconds=12.0)
    case = case.roughly()
    base = base_of(case, fitted(case))
    (best,) = [one for one in swings(base, spots(case.segment)) if one.added.at == "drive.u"]
    assert best.added.values["frequency"] == pytest.approx(2.93, abs=0.05)
    assert best.added.values["amplitude"] == pytest.approx(9e-4, rel=0.3)
