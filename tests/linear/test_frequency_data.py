"""Frequency-response data in and out: python-control's data of delayed systems, and fits of data."""

import control as ct
import numpy as np
import pytest

from delaytools import delay, fit
from delaytools.linear.convert import frequency_data, response_of
from delaytools.signals.trouble import AnalysisError

OMEGA = np.geomspace(0.1, 300.0, 400)
PLANT = ct.tf([14050.0], [1.0, 17.86, 14050.0])


def test_data_of_a_delayed_system_are_exact() -> None:
    data = frequency_data(delay(0.02) * PLANT, OMEGA)
    s = 1j * OMEGA
    known = 14050 / (s**2 + 17.86 * s + 14050) * np.exp(-0.02 * s)
    assert np.allclose(data.frdata[0, 0], known, rtol=1e-12, atol=0)
    assert np.allclose((data * PLANT).frdata[0, 0], known**2 * np.exp(0.02 * s), rtol=1e-9)


def test_several_inputs_and_outputs_keep_their_places() -> None:
    gains = [[[1.0], [2.0]], [[3.0], [4.0]], [[5.0], [6.0]]]
    data = frequency_data(ct.tf(gains, [[[1.0, k + 1.0] for k in range(2)] for _ in range(3)]), OMEGA[:5])
    assert data.frdata.shape == (3, 2, 5)
    assert data.frdata[2, 1, 3] == pytest.approx(6.0 / (1j * OMEGA[3] + 2.0), rel=1e-9)


def test_margins_of_the_data_are_those_of_the_system() -> None:
    loop = delay(0.02) * 3 * PLANT * ct.tf([1.0], [0.5, 1.0])
    found = ct.stability_margins(frequency_data(loop, OMEGA))
    assert found[1] == pytest.approx(102.5125678653, rel=1e-3)  # deg, thesis 3.8 with K = 3


def test_a_fit_of_data_is_the_plant() -> None:
    found = fit(response_of(frequency_data(PLANT, OMEGA)))
    assert found.natural_frequency == pytest.approx(np.sqrt(14050.0), rel=1e-6)
    assert found.damping == pytest.approx(17.86 / 2 / np.sqrt(14050.0), rel=1e-6)


def test_a_product_of_system_and_data_says_what_to_do() -> None:
    with pytest.raises(AnalysisError, match="frequency_data"):
        delay(0.1) * ct.frd([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])
