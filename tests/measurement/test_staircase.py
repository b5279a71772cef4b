"""A staircase in a log is a held signal; noise and smooth signals are not."""

import numpy as np
import pytest

from delaytools.estimation.low_order import fit
from delaytools.measurement.staircase import with_staircases_held
from delaytools.signals.record import Record
from delaytools.simulation.simulate import simulate
from tests.simulation.benches import DOUBLET, roll_bench


def test_only_the_staircase_is_held() -> None:
    t = np.arange(2000) * 1e-3
    columns = {
        "stairs": np.repeat(np.random.default_rng(1).standard_normal(400), 5),
        "noise": np.random.default_rng(2).standard_normal(2000),
        "sine": np.sin(20 * t),
        "constant": np.ones(2000),
        "one step": (t > 1.0).astype(float),
    }
    found, words = with_staircases_held(Record(t, columns))
    assert found.held == {"stairs"}
    assert words == ("stairs changes only every 5 rows: it is taken to be held between",)


def test_an_actuator_behind_a_held_command_is_fitted_right() -> None:
    """Without the hold its natural frequency would come out 9 rad/s too low."""
    run = simulate(roll_bench(), DOUBLET, duration=3.0).record
    bare = Record(run.time, dict(run.columns), dict(run.units))
    found = fit(with_staircases_held(bare)[0], "fin_command", "fin_position")
    assert found.natural_frequency == pytest.approx(180.0, rel=1e-3)
    assert abs(fit(bare, "fin_command", "fin_position").natural_frequency - 180.0) > 2.0
