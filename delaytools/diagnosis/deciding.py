"""What tells two effects apart on a bench, in words: rules of thumb, and what to do where no input helps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.diagnosis.added import Added
from delaytools.diagnosis.answer import NextExperiment
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.trials import BIAS, DOUBLE, LOOP_BACK, SINE, TRIANGLE, Trial
from delaytools.loop.network import network
from delaytools.loop.port import find_port, written_behind
from delaytools.loop.values import resolve

__all__ = ["Words", "inseparable", "words"]

FRICTION = ("coulomb_friction", "stribeck_friction", "load_dependent_friction")
LATE = ("delay", "variable_delay")

# kinds of one, kinds of the other, manner of trial, reason
RULES: tuple[tuple[tuple[str, ...], tuple[str, ...], str, str], ...] = (
    (LATE, ("lag",), SINE, "a delay leaves the size of a fast sine as it is, a lag takes it down"),
    (("dead_band",), ("backlash",), BIAS,
     "about a bias a dead band passes everything, play still takes its width at every reversal"),
    (FRICTION, ("backlash", "dead_band"), TRIANGLE,
     "friction rounds a slow triangle by the force that it needs to move, play by a gap of constant width"),
    (("rate_limit", "saturation"), ("lag", *LATE), DOUBLE,
     "a limit takes a larger share of a larger signal, a linear element the same share"),
)  # fmt: skip


@final
@dataclass(frozen=True)
class Words:
    """The names of the rivals, and the rule of thumb for them: its manner of trial ("" where there is none)."""

    names: str
    manner: str
    reason: str

    def sentence(self, trial: Trial) -> str:
        """Why this trial."""
        reason = f": {self.reason}" if self.reason and trial.manner == self.manner else ""
        return f"{self.names} explain the logs equally well; {_told(trial)} would tell them apart{reason}"


def words(best: Fitted, rivals: Sequence[Fitted]) -> Words:
    """What is known of telling these apart; the rule for the best and its nearest rival."""
    every = [_differing(best, rivals[0]), *(_differing(rival, best) for rival in rivals)]
    names = ", ".join(one.name for one in every[:-1]) + f" and {every[-1].name}"
    for first, second, manner, reason in RULES:
        for one, other in ((every[0].kind, every[1].kind), (every[1].kind, every[0].kind)):
            if one in first and other in second:
                return Words(names, manner, reason)
    return Words(names, "", "")


def _differing(fitted: Fitted, other: Fitted) -> Added:
    """The effect of a hypothesis that the other one has not."""
    taken = {one.key for one in other.added}
    return next((one for one in reversed(fitted.added) if one.key not in taken), fitted.added[-1])


def _told(trial: Trial) -> str:
    unit = f" of {trial.signal}"
    if trial.manner == SINE:
        return f"a sine{unit} at {trial.table['frequency']:g} Hz"
    if trial.manner == DOUBLE:
        return f"double the amplitude of a sine{unit} at {trial.table['frequency']:g} Hz"
    return f"a {trial.manner}{unit}"


def inseparable(
    case: Case, best: Fitted, rivals: Sequence[Fitted], catalogue: Sequence[Trial]
) -> NextExperiment | None:
    """What to do where no input of the segment decides: measure in between, or send a pulse to the recorder alone."""
    rivals_own = [_differing(rival, best) for rival in rivals]
    mine = _differing(best, rivals[0])
    names = words(best, rivals).names
    told = f"no input within what the logs showed tells {names} apart"
    between = _between(case, mine, rivals_own[0])
    measure = f"measure {' or '.join(between)} as well" if between else _inside(case, mine)
    pulse = next((trial for trial in catalogue if trial.manner == LOOP_BACK), None)
    if pulse is not None and all(one.kind in LATE for one in (mine, *rivals_own)):
        why = (
            f"{told}: send a pulse to the recorder's channels of {pulse.signal} and {case.exits[0]} at once "
            f"(loop-back), which shows the offset of their clocks alone; what is left is delay. Or {measure}"
        )
        return NextExperiment(why, {"signal": pulse.signal, **pulse.table}, 0.0)
    return NextExperiment(f"{told}: {measure}", {"measure": list(between)} if between else {}, 0.0)


def _between(case: Case, one: Added, other: Added) -> tuple[str, ...]:
    """Signals between the places of two effects that are not measured."""
    loop = case.segment.loop
    along = dict.fromkeys(name for name, _ in network(resolve(loop)).order)
    order = [name for name in along if name in case.segment.blocks]
    places = sorted(order.index(find_port(loop, a.at).element) for a in (one, other))
    inner = [written_behind(loop, s) for name in order[places[0] : places[1]] for s in loop[name].outputs.values()]
    measured = {*case.exits, *case.records[0].names}
    return tuple(dict.fromkeys(s for s in inner if s not in measured))


def _inside(case: Case, one: Added) -> str:
    block = find_port(case.segment.loop, one.at).element
    return f"measure {block} alone, with a second pick-off at its input and its output"
