"""Steps of quantisers that a log shows through its noise, and what noise ahead of one leaves."""

from dataclasses import replace

import numpy as np
import pytest

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.lattices import step_through_noise
from delaytools.diagnosis.leftover import unexplained
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.diagnosis.rounding import roundings
from delaytools.signals.record import Record
from delaytools.signals.stimulus import Column
from tests.diagnosis.small_cases import ACTUATOR, fitted, planted

STEP = 0.3892


@pytest.mark.parametrize("near", [0.37, 0.38, 0.3892, 0.41])
def test_a_step_is_known_through_the_noise_behind_it(near: float) -> None:
    values = 12.0 * np.sin(np.arange(20_000) * 1e-3)
    draw = np.random.default_rng(4)
    shown = STEP * np.round(values / STEP) + 0.02 * draw.standard_normal(len(values))
    found = step_through_noise(shown, near)
    assert found is not None
    step, error = found
    assert abs(step - STEP) < 4 * error < 1e-4
    assert step_through_noise(values, near) is None
    assert step_through_noise(shown + 0.15 * draw.standard_normal(len(values)), near) is None


def test_noise_ahead_of_a_quantiser_leaves_no_structure() -> None:
    """At rest near an edge of a step the rounding of signal and noise is, in the mean, off by a part of the step."""
    times = np.arange(0.0, 12.0, 0.5)
    levels = 0.5 + 0.2 * np.sin(7.0 * times)
    stairs = Column(time=times, values=levels, held=True)
    quantiser = Added("quantization", "act.output", {"step": 1.0}, {}, frozenset({"step"}))
    plain = planted(ACTUATOR, (), stairs, noise=0.15, seconds=12.0)
    (record,), (rows,) = plain.records, plain.measured
    rounded = np.floor(rows + 0.5)
    log = Record(record.time, {**record.columns, "x": rounded[:, 0]}, held=record.held)
    case = replace(plain, records=(log,), measured=(rounded,), _replays={})
    case = case.whitened_by(noise_of(case, fitted(case, quantiser), Carried({})))
    one = fitted(case, quantiser)
    left = case.measured[0][:, 0] - case.outputs(one.added, one.values)[0][:, 0]
    means = [left[(log.time >= t + 0.3) & (log.time < t + 0.5)].mean() for t in times]
    assert np.std(means) > 0.15
    assert not unexplained(case, one, (np.zeros(len(log)),))
    kept = roundings(case, one).less_mean(left, "x", 0)
    assert np.std([kept[(log.time >= t + 0.3) & (log.time < t + 0.5)].mean() for t in times]) < 0.06
