"""Runs that bracket the jitter margin from above, against a theorem."""

import numpy as np
import pytest

from delaytools.analysis.jitter_runs import jitter_runs
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.signals.trouble import AnalysisError

INTEGRATOR = """
frame = "20 ms"
[blocks.plant]
type = "integrator"
input = "u"
output = "y"
[blocks.law]
type = "gain"
input = "-y"
output = "u"
gain = {gain}
"""


def test_an_integrator_is_lost_where_myshkis_says() -> None:
    """x' = -x(t - δ(t)) is stable for every δ in [0, h] just where h < 3/2 (Myshkis 1951); small gain says h < 1."""
    found = jitter_runs(build(parse_design(INTEGRATOR.format(gain=1.0))), "u")
    assert found.certain == pytest.approx(1.0, rel=1e-6) and found.sampling == "exact"
    assert 1.5 <= found.lost < 1.52 and found.shape == "held, then followed"


def test_a_delay_that_varies_slowly_loses_it_as_a_constant_one() -> None:
    found = jitter_runs(build(parse_design(INTEGRATOR.format(gain=1.0))), "u", rate=0.05)
    assert found.certain == pytest.approx(np.sqrt(1.95), rel=1e-6)
    assert found.certain < found.lost <= np.pi / 2 * (1 + 1e-9)


def test_a_delay_that_is_there_counts() -> None:
    there = jitter_runs(build(parse_design(INTEGRATOR.format(gain=1.0))), "u", 0.5, rate=0.05)
    assert there.lost <= np.pi / 2 - 0.5 + 1e-9 and there.certain < there.lost


def test_a_loop_that_is_lost_already_is_refused() -> None:
    with pytest.raises(AnalysisError):
        jitter_runs(build(parse_design(INTEGRATOR.format(gain=-1.0))), "u")
