"""A case before its sizes are known: bench, true numbers, excitation, noise, and what is to be planted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.hidden_effects import excitation
from benchmarks.hidden_effects.architecture import Architecture
from benchmarks.hidden_effects.catalogue import amplitude, parameters
from benchmarks.hidden_effects.kinds import Wish, kind_of, wishes
from benchmarks.hidden_effects.pitch import PITCH
from benchmarks.hidden_effects.records import Lane, Planted
from benchmarks.hidden_effects.roll import ROLL
from benchmarks.hidden_effects.servo import SERVO

Array = np.ndarray
Generator = np.random.Generator
ROWS = 20000
ARCHITECTURES = {a.name: a for a in (ROLL, SERVO, PITCH)}
CHANCES = {"roll": 0.5, "servo": 0.25, "pitch": 0.25}
SAME_EFFECT = 4  # attempts before a case turns to the next effect of its kind
OF_TOLERANCE = 0.8  # true values lie within this share of a declared tolerance


@dataclass(frozen=True)
class Case:
    """Everything drawn for a case; `planted` is filled when the sizes are known."""

    number: int
    seed: int
    attempt: int
    kind: str
    architecture: Architecture
    stated: Mapping[str, float]
    truth: Mapping[str, float]
    tolerance: Mapping[str, float]
    externals: Mapping[str, Array]
    shown: tuple[str, ...]
    inside: Mapping[str, Array]
    outside: Mapping[str, Array]
    notes: Mapping[str, object]
    wishes: Sequence[Wish]
    noise_first: bool
    draws: Array
    planted: Sequence[Planted] = ()

    @property
    def name(self) -> str:
        """Folder name."""
        return f"k{self.number:04d}_{self.kind}_{self.architecture.name}"


def generator(seed: int, number: int, attempt: int, stage: int) -> Generator:
    """Random numbers of one stage of one case."""
    return np.random.default_rng([seed, number, attempt, stage])


def architecture_of(number: int, seed: int) -> Architecture:
    """The bench of a case: drawn among those that offer what its kind plants."""
    kind, turn = kind_of(number, seed)
    rng = np.random.default_rng([seed, number])
    names = list(ARCHITECTURES)
    chances = np.array([CHANCES[name] for name in names])
    for name in rng.choice(names, size=len(names), replace=False, p=chances / chances.sum()):
        try:
            wishes(kind, turn, ARCHITECTURES[name], np.random.default_rng(1))
        except LookupError:
            continue
        return ARCHITECTURES[name]
    raise LookupError(f"no bench offers {kind} number {turn}")


def draw(number: int, seed: int, attempt: int) -> Case:
    """Case `number` of a seed; a later attempt is another draw of the same kind on the same bench."""
    kind, turn = kind_of(number, seed)
    bench = architecture_of(number, seed)
    rng = generator(seed, number, attempt, 1)
    plan = _plan(kind, turn + attempt // SAME_EFFECT, bench, rng)
    stated = {
        name: _digits(x * (1 + rng.uniform(-share, share))) for name, (x, share) in bench.numbers.items()
    }
    changed = [name for wish in plan for name in _undecidable(wish)]
    share = 1.0 if kind == "weak_drift" else 0.5
    tolerance = _tolerances(bench, changed, rng) if rng.random() < share else {}
    truth = {
        k: x * (1 + OF_TOLERANCE * tolerance.get(k, 0) / 100 * rng.uniform(-1, 1)) for k, x in stated.items()
    }
    noises, colours = _noises(bench, rng)
    externals, notes = _drive(bench, kind, rng)
    quantised = any(wish.effect in ("quantization", "sample_hold") for wish in plan)
    needed = any(wish.effect in ("cross_coupling", "flexible_mode") for wish in plan)
    other = bench.externals[1]
    shown = bench.externals if needed or rng.random() < 0.4 else bench.externals[:1]
    return Case(
        number=number,
        seed=seed,
        attempt=attempt,
        kind=kind,
        architecture=bench,
        stated=stated,
        truth=truth,
        tolerance=tolerance,
        externals=externals,
        shown=tuple(name for name in bench.externals if name != other or name in shown),
        inside={name: noises[name] for name in bench.inside_noise},
        outside={name: noises[name] for name in bench.outside_noise},
        notes=notes | {"noise_corner_hz": colours},
        wishes=plan,
        noise_first=bool(quantised and rng.random() < 0.5),
        draws=generator(seed, number, attempt, 4).random(ROWS),
    )


def _plan(kind: str, turn: int, bench: Architecture, rng: Generator) -> list[Wish]:
    """What is planted; where the bench does not offer it, the next of its kind."""
    try:
        return wishes(kind, turn, bench, rng)
    except LookupError:
        return _plan(kind, turn + 1, bench, rng)


def _drive(bench: Architecture, kind: str, rng: Generator) -> tuple[dict[str, Array], dict[str, object]]:
    shapes = list(excitation.WEIGHTS)
    chances = np.array([excitation.WEIGHTS[s] for s in shapes], dtype=float)
    form = str(rng.choice(shapes, p=chances / chances.sum()))
    if kind == "rest_quantisation":
        form = "rest_doublet"
    low, high = bench.demand_size
    size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    main, other = bench.externals
    columns = {main: excitation.demand(form, size, ROWS, rng), other: excitation.unrelated(ROWS, rng)}
    return columns, {"excitation": form, "demand_size": size}


def _undecidable(wish: Wish) -> tuple[str, ...]:
    """Numbers of the loop whose tolerance would hide this effect."""
    if wish.effect == "parameter_change":
        return wish.offer.changes
    return tuple(name for effect, name in wish.offer.same_as.items() if effect == wish.effect)


def _tolerances(bench: Architecture, changed: Sequence[str], rng: Generator) -> dict[str, float]:
    names = [name for name in bench.tolerances if name not in changed]
    count = int(rng.integers(min(2, len(names)), len(names) + 1)) if names else 0
    chosen = set(rng.choice(names, size=count, replace=False)) if count else set()
    return {name: bench.tolerances[name] for name in names if name in chosen}


def _noises(bench: Architecture, rng: Generator) -> tuple[dict[str, Array], dict[str, float | None]]:
    rows, colours = {}, {}
    for name, rms in {**bench.inside_noise, **bench.outside_noise}.items():
        corner = float(np.exp(rng.uniform(np.log(15), np.log(120)))) if rng.random() < 0.2 else None
        rows[name], colours[name] = excitation.noise(rms, corner, ROWS, rng), corner
    return rows, colours


def _digits(value: float) -> float:
    return float(f"{value:.4g}")


def plant(case: Case, drawn: Sequence[Mapping], shares: Sequence[float], scales: Sequence) -> Case:
    """The case with its effects at these shares of their ranges."""
    planted = []
    for wish, other, share, scale in zip(case.wishes, drawn, shares, scales, strict=True):
        numbers = parameters(wish.effect, amplitude(wish.effect, share, scale), other["shape"])
        effect, source = wish.effect, other["source"]
        if effect == "parameter_change":
            path = other["change"]
            effect, numbers = (
                f"parameter_change:{path.split('.', 1)[1]}",
                {path.split(".", 1)[1]: float(f"{case.truth[path] * (1 + numbers['change']):.5g}")},
            )
        judged = wish.offer.judged or wish.offer.exits[:1]
        planted.append(Planted(effect, wish.offer.port, numbers, wish.offer.exits, source, judged))
    return replace(case, planted=planted)


def lane(case: Case, without: int | None = None, parent: int | None = None, noisy: bool = True) -> Lane:
    """The case as a lane of the simulator, `without` one of its effects."""
    effects = [e for i, e in enumerate(case.planted) if i != without]
    values = dict(case.truth)
    for e in effects:
        if e.effect.startswith("parameter_change:"):
            values |= {f"{e.port}.{name}": number for name, number in e.parameters.items()}
    return Lane(
        values=values,
        effects=effects,
        externals=case.externals,
        noise=case.inside if noisy else {},
        noise_first=case.noise_first,
        draws=case.draws,
        parent=parent,
    )
