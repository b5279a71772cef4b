"""Simple terms that an unknown effect may look like, and how the segment answers to them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from delaytools.diagnosis.added import Added, with_added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.noise_of import without_noise
from delaytools.loop.port import ports
from delaytools.signals.stimulus import Column
from delaytools.signals.trouble import DelaytoolsError
from delaytools.simulation.replay import Replay

__all__ = ["Ground", "Way", "ground", "ways"]

Array = NDArray[np.float64]
ENTRIES, WAYS = 3, 4
SMOOTH = 0.05  # of the rms rate: width of a smoothed sign
LARGE = 0.5  # rad
PULSE = "hint@pulse"
TINY = 1e-3  # of the exit's spread: size of the response by which a way is measured

OF_INPUT: dict[str, Callable[[Array], Array]] = {
    "{}²": lambda u: u**2,
    "{}³": lambda u: u**3,
    "|{}|": np.abs,
    "sign({0})·sqrt|{0}|": lambda u: np.sign(u) * np.sqrt(np.abs(u)),
}
OF_STATE: dict[str, Callable[[Array], Array]] = {
    "{}³": lambda x: x**3,
    "{0}·|{0}|": lambda x: x * np.abs(x),
    "|{}|": np.abs,
}
OF_RATE: dict[str, Callable[[Array], Array]] = {
    "{0}·|{0}|": lambda v: v * np.abs(v),
    "{}³": lambda v: v**3,
    "sign({})": lambda v: np.tanh(v / max(SMOOTH * float(np.sqrt(np.mean(v**2))), 1e-300)),
}


@final
@dataclass(frozen=True, eq=False)
class Ground:
    """Per log: linear terms (n, m), which a fit already had, and the other terms (n, k) with their names.

    shown: terms of the model's exits, for what acts on the exit itself; inside: of the measured ones, for forces.
    Linear terms are of the model's exits: fed with measured ones they would explain whatever was measured.
    """

    linear: tuple[Array, ...]
    shown: tuple[Array, ...]
    inside: tuple[Array, ...]
    names: tuple[str, ...]


@final
@dataclass(frozen=True, eq=False)
class Way:
    """How a term reaches the exit: `at` a port by its response (n,) to one row's triangle, or straight (None)."""

    at: str
    response: Array | None

    def carried(self, columns: Array) -> Array:
        """(n, k): what the columns become at the exit."""
        if self.response is None:
            return columns
        answer = self.response[: len(columns), None]
        return np.asarray(fftconvolve(columns, answer, axes=0))[: len(columns)]


def ground(case: Case, fitted: Fitted, exit: int) -> Ground:
    """The terms of what drives the segment and of what leaves it."""
    models = case.outputs(fitted.added, fitted.values)
    logs = range(len(case.records))
    measured = [
        np.stack([without_noise(case.measured[k][:, j], models[k][:, j], name in case.records[k].held)
                  for j, name in enumerate(case.exits)], axis=1) for k in logs
    ]
    shown = [_terms(case, models[k], k, exit) for k in logs]
    inside = [_terms(case, measured[k], k, exit) for k in logs]
    names = tuple(name for name in shown[0] if all(name in one for one in (*shown, *inside)))
    return Ground(
        tuple(_linear(case, models[k], k) for k in logs),
        tuple(np.stack([one[name] for name in names], axis=1) for one in shown),
        tuple(np.stack([one[name] for name in names], axis=1) for one in inside),
        names,
    )


def _linear(case: Case, exits: Array, log: int) -> Array:
    record = case.records[log]
    rates = np.gradient(exits, case.step, axis=0)
    entries = [record[name] for name in _moving(case)[:ENTRIES]]
    return np.column_stack([np.ones(len(record)), *entries, exits, rates])


def _terms(case: Case, exits: Array, log: int, exit: int) -> dict[str, Array]:
    record = case.records[log]
    time = record.time - record.time[0]
    found: dict[str, Array] = {}
    for name in _moving(case)[:ENTRIES]:
        u = record[name]
        found |= {text.format(name): term(u) for text, term in OF_INPUT.items()} | {f"t·{name}": time * u}
    for name, x in zip(case.exits, exits.T, strict=True):
        found |= {text.format(name): term(x) for text, term in OF_STATE.items()} | {f"t·{name}": time * x}
        found |= _sine(case, name, x)
    own = np.gradient(exits[:, exit], case.step)
    return found | {text.format(f"d({case.exits[exit]})/dt"): term(own) for text, term in OF_RATE.items()}


def _sine(case: Case, name: str, x: Array) -> dict[str, Array]:
    """What of the sine of an angle is not linear, where the angle is so large that this is no mere cube."""
    scale = {"deg": np.pi / 180, "rad": 1.0}.get(case.segment.loop.units.get(name, ""))
    return (
        {}
        if scale is None or scale * float(np.abs(x).max()) < LARGE
        else {f"sin({name})": np.sin(scale * x) - scale * x}
    )


def _moving(case: Case) -> list[str]:
    record = case.records[0]
    return [
        n
        for n in case.segment.entries
        if n in record and n not in case.exits and float(np.ptp(record[n])) > 0
    ]


def ways(case: Case, exit: int) -> tuple[Way, ...]:
    """Straight to the exit, and through the segment from its derivatives, or its inputs where it has none."""
    element = [case.segment.loop[name] for name in case.segment.blocks]
    forces = [str(p) for e in element for p in ports(e) if p.kind == "derivative"]
    entries = [str(p) for e in element for p in ports(e) if p.kind == "input"]
    found = [Way("", None)]
    for at in (forces or entries)[:WAYS]:
        response = _response(case, at, exit)
        if response is not None:
            found.append(Way(at, response))
    return tuple(found)


def _response(case: Case, at: str, exit: int) -> Array | None:
    """(n,): what a triangle one row wide and 1 high at a port does to the exit, along the first log."""
    height = 1.0
    spread = float(np.std(case.measured[0][:, exit])) or 1.0
    for _ in range(2):
        try:
            change = (_pulsed(case, at, height) - _pulsed(case, at, 0.0))[:, exit]
        except (DelaytoolsError, ValueError):
            return None
        top = float(np.abs(change).max())
        if not np.isfinite(top) or top == 0:
            return None
        answer = change / height
        height *= TINY * spread / top
    return np.append(answer[1:], answer[-1])


def _pulsed(case: Case, at: str, height: float) -> Array:
    loop = with_added(case.segment.loop, (Added("cross_coupling", at, {"gain": 1.0}, {"source": PULSE}),))
    time = case.records[0].time - case.records[0].time[0]
    shape = np.zeros(len(time))
    shape[1] = height
    stimuli = {
        **case.stimuli_for(case.records[0], case.segment.loop.externals),
        PULSE: Column(time=time, values=shape),
    }
    return Replay(loop, stimuli, time, case.exits).run()
