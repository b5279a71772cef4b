"""When an entry jumps between two rows nobody knows when: no effect is to explain what that adds up to."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
import pytest
from numpy.typing import NDArray

from delaytools.diagnosis.case import Case
from delaytools.diagnosis.noise_of import Carried
from delaytools.diagnosis.nuisance import with_nuisance_of
from delaytools.diagnosis.search import search
from delaytools.signals.stimulus import Stimulus
from tests.diagnosis.small_cases import ACTUATOR, SLIDE, fitted, planted

STEP = 1e-3
NOISE = {ACTUATOR: 5e-4, SLIDE: 1e-6}  # the faster one, 60 rad/s, answers to where in the row the rest lies as well


@final
@dataclass(frozen=True)
class Window(Stimulus):
    """A wave that is half as large again from the first jump to the second."""

    begin: float
    end: float

    @property
    def jumps(self) -> tuple[float, ...]:
        return self.begin, self.end

    def value(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        inside = (t >= self.begin) & (t < self.end)
        return np.asarray(3 * np.sin(5 * t + 1) * (1 + 0.5 * inside))


def bench(text: str, late: float) -> Case:
    """The log of a window whose edges lie so late in their rows, 1 at the end."""
    case = planted(text, (), Window(2.0 + (late - 1) * STEP, 3.2 + (late - 1) * STEP), noise=NOISE[text])
    white = tuple(replace(one, taps=np.array([1 / NOISE[text]])) for one in case.whitening)
    return replace(case, smooth=frozenset({"u"}), whitening=white, _replays={})


@pytest.mark.parametrize("text", [ACTUATOR, SLIDE])
@pytest.mark.parametrize("late", [0.05, 0.5, 0.8, 1.0])
def test_a_jump_within_a_row_is_no_residual(text: str, late: float) -> None:
    case = bench(text, late)
    bare = fitted(case)
    seen = with_nuisance_of(case, bare)
    assert seen.nuisance[0].shape == (len(case.records[0]), 1, 2)
    left = fitted(seen).chi2 / len(bare.residual)
    assert left < 1.5
    if late != 0.5:
        assert bare.chi2 > fitted(seen).chi2 + 200


def test_nothing_is_named_for_it() -> None:
    found = search(bench(SLIDE, 1.0), Carried({}))
    assert found.fitted.added == ()


def test_what_comes_from_outside_is_taken_as_it_is() -> None:
    case = replace(bench(SLIDE, 1.0), outside=frozenset({"u"}))
    assert with_nuisance_of(case, fitted(case)).nuisance == ()


def test_an_entry_that_jumps_all_the_time_is_taken_as_it_is() -> None:
    case = bench(SLIDE, 1.0)
    record = case.records[0]
    rows = np.repeat(record["u"][::50], 50)[: len(record)]
    case = replace(case, records=(replace(record, columns={**record.columns, "u": rows}),), _replays={})
    assert with_nuisance_of(case, fitted(case)).nuisance == ()
