"""Logs in pieces, which are real runs: what is sought in them, and what they cannot show."""

from dataclasses import replace

import numpy as np
import pytest

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.noise_of import Carried, noise_of
from delaytools.diagnosis.places import spots
from delaytools.diagnosis.screen import base_of
from delaytools.diagnosis.search import search
from delaytools.diagnosis.segment_report import segment_report
from delaytools.diagnosis.spectra import interferences
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import NOISE, SLIDE, fitted, planted

PUSH = Multisine(amplitude=10.0, from_frequency=0.3, to_frequency=6.0, lines=25)


def _in_pieces(case: Case, length: int) -> Case:
    rows = len(case.records[0])
    pieces = tuple((first, min(first + length, rows)) for first in range(0, rows, length))
    noise = NOISE * np.random.default_rng(3).standard_normal(case.measured[0].shape)
    return replace(case, measured=(case.measured[0] + noise,), pieces=(pieces,), _replays={})


@pytest.mark.parametrize(("length", "shown"), [(5000, True), (800, False)])
def test_a_wave_is_sought_where_some_piece_shows_a_whole_period(length: int, shown: bool) -> None:
    wave = Added("periodic_interference", "drive.x", {"amplitude": 0.3, "frequency": 0.9, "phase": 0.4})
    case = _in_pieces(planted(SLIDE, (wave,), PUSH), length)
    case = case.whitened_by(noise_of(case, fitted(case), Carried({})))
    found = interferences(base_of(case, fitted(case)), spots(case.segment))
    slowest = min(one.added.values["frequency"] for one in found)
    assert (abs(slowest - 0.9) < 0.1) if shown else slowest >= 1 / 0.8


def test_a_real_run_is_given_two_effects_at_most() -> None:
    three = (
        Added("coulomb_friction", "drive.v'", {"level": 2.0, "smoothing": 0.02}),
        Added("constant_disturbance", "drive.v'", {"level": 2.0}),
        Added("cubic_stiffness", "drive.v'", {"coefficient": -40.0}),
    )
    found = search(_in_pieces(planted(SLIDE, three, PUSH, seconds=4.0), 2000), Carried({}))
    assert len(found.fitted.added) == 2
    assert any("the most that a real run is given" in words for words in segment_report(found).notes)
