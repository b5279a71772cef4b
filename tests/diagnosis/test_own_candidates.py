"""An effect that is not in the catalogue takes part in the search like one that is."""

from dataclasses import dataclass
from typing import final

import pytest

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.formula import FormulaBlock
from delaytools.design.catalogue import with_effects
from delaytools.diagnosis.added import Added
from delaytools.diagnosis.diagnose import Effort, diagnose
from delaytools.diagnosis.fitting import fit_hypothesis
from delaytools.diagnosis.own_candidates import own_candidates
from delaytools.diagnosis.screen import base_of, screened
from delaytools.diagnosis.views import case_view
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop
from delaytools.signals.expression import Expression
from delaytools.signals.stimulus import Multisine
from tests.diagnosis.small_cases import ACTUATOR, fitted, planted
from tests.measurement.bench_logs import bench_design, bench_log

INPUT = Multisine(amplitude=2.0, from_frequency=0.3, to_frequency=8.0, lines=20)


@final
@dataclass(frozen=True, kw_only=True)
class BentEffect(Effect):
    """y = u + bend u²."""

    bend: Scalar = value(neutral=0.0)

    kind = "bent"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge("What.", "Cause.", "Margins.", "Check.")

    def apply(self, loop: Loop, place: Place) -> Loop:
        block = FormulaBlock(
            formula=Expression("u + bend*u**2"), parameters={"bend": self.bend}, neutral={"bend": 0.0}
        )
        return insert_at(loop, place, self, block)


def test_it_is_screened_and_fitted() -> None:
    with with_effects(BentEffect):
        case = planted(ACTUATOR, (Added("bent", "act.output", {"bend": 0.03}),), INPUT)
        null = fitted(case)
        found = screened(base_of(case, null), own_candidates(case_view(case, null)))
        best = max(found, key=lambda one: one.gain)
        assert best.added.kind == "bent" and best.added.at == "act.output"
        after = fit_hypothesis(case, (best.added,), near=null)
        assert after.added[0].values["bend"] == pytest.approx(0.03, rel=0.02)
        assert after.chi2 < 1.1 * len(after.residual)


def test_a_diagnosis_finds_it_in_a_log() -> None:
    with with_effects(BentEffect):
        log = bench_log({"type": "bent", "at": "actuator.output", "bend": 0.05}, duration=4.0)
        found = diagnose(bench_design(), [log], effort=Effort(processes=1, budget=60.0, signals=("fin",)))
    assert found.verdict == "missing"
    assert [(one.effect, one.at) for one in found.missing] == [("bent", "actuator.output")]
    assert found.missing[0].parameters["bend"].value == pytest.approx(0.05, rel=0.02)


def test_without_one_there_is_none() -> None:
    case = planted(ACTUATOR, (), INPUT)
    assert own_candidates(case_view(case, fitted(case))) == ()
