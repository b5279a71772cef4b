"""Effects at one port act in order along the signal; the one that is found first need not stand first."""

import numpy as np
import pytest

from delaytools.diagnosis.added import Added, places_in_file
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.lattices import ahead_of_lattice
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.search import search
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import ACTUATOR, planted

WAVE = Multisine(amplitude=3.0, from_frequency=0.3, to_frequency=6.0, lines=25)
LIMIT = Added("saturation", "act.output", {"limit": 2.0})
OFFSET = Added("bias", "act.output", {"level": 1.5})


def test_what_is_found_last_may_stand_first() -> None:
    order = (LIMIT, OFFSET)
    found = search(planted(ACTUATOR, order, WAVE, seconds=3.0), Carried({"u": 0.0}))
    fitted = found.fitted
    places = places_in_file(fitted.added)
    assert [fitted.added[k].kind for k in places] == [one.kind for one in order]
    for place, one in zip(places, order, strict=True):
        (name,) = one.values
        path = f"effects.{1000 + place}.{name}"
        assert fitted.by_path[path].value == pytest.approx(one.values[name], rel=0.02)


def test_behind_a_quantiser_whose_lattice_the_log_shows_nothing_stands() -> None:
    rounded = Added("quantization", "act.output", {"step": 0.2}, {}, frozenset({"step"}))
    shown = planted(ACTUATOR, (rounded,), WAVE, noise=0.0)
    smeared = planted(ACTUATOR, (rounded,), WAVE)
    for case, first in ((shown, True), (smeared, False)):
        known = Fitted((rounded,), case.parameters((rounded,)), np.zeros(0), np.zeros((0, 0)))
        both = (rounded, ahead_of_lattice(case, known, OFFSET))
        assert places_in_file(both) == ((1, 0) if first else (0, 1))
    elsewhere = Added("bias", "act.input", {"level": 1.5})
    assert ahead_of_lattice(shown, known, elsewhere) is elsewhere


def test_rank_orders_a_port_and_leaves_the_others() -> None:
    lag = Added("lag", "act.input", {"time_constant": 0.01})
    first = Added("bias", "act.output", {"level": 1.0}, rank=-1)
    assert places_in_file((LIMIT, lag, first)) == (2, 1, 0)
    case = planted(ACTUATOR, (OFFSET, LIMIT), WAVE)
    other = (LIMIT, Added("bias", "act.output", {"level": 1.5}, rank=-1))
    assert np.allclose(*(case.outputs(added, values)[0] for added, values in (
        ((OFFSET, LIMIT), _values(case, (OFFSET, LIMIT))), (other, _values(case, other)))))  # fmt: skip


def _values(case, added: tuple[Added, ...]) -> tuple[float, ...]:
    return tuple(p.value for p in case.parameters(added))
