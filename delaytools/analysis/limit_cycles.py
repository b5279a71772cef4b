"""Limit cycles of a loop: predicted by describing functions with exact delay, and checked by simulation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from delaytools.analysis.cycle_check import Checked, Predicted, checked
from delaytools.analysis.cycle_search import balanced_oscillations
from delaytools.analysis.cycle_stability import growth, other_growth, piece_gains, root_with_gains
from delaytools.analysis.harmonic_balance import Balance, Oscillation, balance_of, with_delay
from delaytools.analysis.margins import Sampling
from delaytools.analysis.opened_loop import EXTRA, with_extra_delay, writer_port
from delaytools.analysis.relay_cycles import RelayCycle, relay_cycles
from delaytools.blocks.relay import Relay
from delaytools.loop.edit import cut
from delaytools.loop.loop import Loop
from delaytools.loop.nonlinear_parts import NonlinearPart
from delaytools.loop.values import resolve, with_numbers
from delaytools.signals.trouble import AnalysisError

__all__ = ["LimitCycle", "LimitCycles", "PieceAtWork", "limit_cycles"]

_ALIKE = 1.5  # times in frequency within which an exact cycle is the one predicted
_UNSTABLE = 1e-6  # of the cycle's frequency: a root this far right grows


@final
@dataclass(frozen=True)
class PieceAtWork:
    """What one nonlinear piece does in a cycle.

    amplitude: at what enters it (the largest of its arguments). gain, phase (rad): of its describing function (NaN
    where it has several arguments). drives: without it (a wire, no friction) the oscillation would die out; None where
    that has no meaning.
    """

    name: str
    amplitude: float
    gain: float
    phase: float
    drives: bool | None


@final
@dataclass(frozen=True)
class LimitCycle:
    """One predicted limit cycle.

    delay: extra delay, s. amplitude: of the signal `at`, in its unit; signals: of every signal. frequency: Hz. stable:
    whether it lasts. growth: a dσ/da, 1/s: a cycle that is 1 % too large is so by 1 % e^{growth t}. distortion:
    harmonics beside the first where they are strongest; a prediction is about as good as this is small. check: what
    simulation says, None where it was not asked. exact: where the only nonlinear piece is a relay, what enters it.
    """

    delay: float
    amplitude: float
    frequency: float
    stable: bool
    growth: float
    distortion: float
    signals: Mapping[str, float]
    pieces: tuple[PieceAtWork, ...]
    check: Checked | None
    exact: RelayCycle | None


@final
@dataclass(frozen=True)
class LimitCycles:
    """All limit cycles found, by delay and frequency. nonlinear: the pieces looked at; why: in words, where none is."""

    cycles: tuple[LimitCycle, ...]
    at: str
    delay_at: str
    nonlinear: tuple[str, ...]
    sampling: Sampling
    linearised_without: tuple[str, ...]
    why: str


def limit_cycles(
    loop: Loop,
    at: str,
    delays: Sequence[float] | None = None,
    *,
    delay_at: str | None = None,
    check: bool = True,
    progress: Callable[[str], None] = lambda words: None,
) -> LimitCycles:
    """Every limit cycle with all external inputs at zero, for each extra delay (s) at the port `delay_at`.

    Each nonlinear block, effect and formula is replaced by the gain N(A, ω) of its first harmonic; the balance
    U = G(jω) N U is solved for all of them at once, means too where something is not symmetric. Delays are exact, holds
    are (1 - e^{-sT})/(sT). It lasts where the quasi-linear root moves left with growing amplitude (Gelb & Vander Velde
    1968, sec. 3.4) and no other root is right of the axis. check: the loop itself is run from below and above.
    Raises DesignError for an unknown signal or port, AnalysisError for a delay that is negative or not finite.
    """
    wanted = [0.0] if delays is None else [float(tau) for tau in delays]
    if not all(np.isfinite(tau) and tau >= 0 for tau in wanted):
        raise AnalysisError("an extra delay is finite and not negative", found=f"{wanted}")
    loop = resolve(loop)
    cut(loop, at)  # raises where no block writes it
    port = delay_at or writer_port(loop, at)
    delayed = with_extra_delay(loop, port)
    signals = tuple(name for name in loop.signals if name in loop.writers)
    balance = balance_of(delayed, signals)
    transport = [element.name for element in delayed.transports].index(EXTRA)
    found: list[LimitCycle] = []
    looked_at = [with_delay(balance, transport, tau) for tau in wanted] if balance.parts else []
    for tau, here in zip(wanted, looked_at, strict=False):
        progress(f"limit cycles at {tau * 1e3:.4g} ms")
        runs = with_numbers(delayed, {f"{EXTRA}.delay": tau}) if check else None
        balanced = balanced_oscillations(here)
        exact = _exact_about(here, [one.s.imag / (2 * np.pi) for one in balanced])
        found += [_cycle(here, one, at, tau, runs, exact) for one in balanced]
    names = tuple(part.name for part in balance.parts)
    sampling: Sampling = "continuous approximation" if balance.still.samplers else "exact"
    return LimitCycles(tuple(found), at, port, names, sampling, balance.without, _why(looked_at, found))


def _why(looked_at: Sequence[Balance], found: Sequence[LimitCycle]) -> str:
    if found:
        return ""
    if not looked_at:
        return "nothing in the loop depends on amplitude: what oscillates in a linear loop grows or dies out"
    words = "no amplitude and frequency at which the first harmonics balance"
    exact = [one for here in looked_at for one in _exact(here, _wide(here))]
    if exact:
        one = exact[0]
        words += f"; but the relay itself has a cycle of {one.frequency:.6g} Hz, {one.amplitude:.6g} enters it"
    return words


def _wide(balance: Balance) -> tuple[float, float]:
    """The frequencies (Hz) between which the linear rest does anything of its own."""
    return float(balance.net[0]) / (2 * np.pi), float(balance.net[-1]) / (2 * np.pi)


def _cycle(
    balance: Balance, found: Oscillation, at: str, tau: float, runs: Loop | None, exact: Sequence[RelayCycle]
) -> LimitCycle:
    gains = piece_gains(balance, found)
    sizes = np.abs(found.amplitude)
    reference = int(np.argmax(sizes > 1e-6 * sizes.max()))
    rate = growth(balance, found, reference)
    others = other_growth(balance, found, gains)
    stable = bool(rate < 0 and others <= _UNSTABLE * found.s.imag)
    signals = _signals(balance, found)
    frequency = found.s.imag / (2 * np.pi)
    predicted = Predicted(signals[at], frequency, rate, stable)
    verdict = checked(runs, at, predicted) if runs is not None and signals[at] > 0 else None
    pieces = tuple(_at_work(balance, found, gains, index) for index in range(len(balance.parts)))
    return LimitCycle(
        tau, signals[at], frequency, stable, rate, balance.distortion(found), signals, pieces, verdict,
        _nearest(exact, frequency),
    )  # fmt: skip


def _exact(balance: Balance, hertz: tuple[float, float]) -> tuple[RelayCycle, ...]:
    """The cycles between two frequencies as they are, where that can be told: one relay alone, nothing one-sided."""
    block = balance.parts[0].block
    if len(balance.parts) != 1 or not isinstance(block, Relay) or balance.lopsided:
        return ()
    around = balance.system[slice(0, 1), slice(0, 1)]
    return relay_cycles(around, float(block.level), float(block.half_width), hertz) or ()


def _exact_about(balance: Balance, frequencies: Sequence[float]) -> tuple[RelayCycle, ...]:
    """The exact cycles as slow or fast as some of these predicted ones (Hz)."""
    return _exact(balance, (min(frequencies) / _ALIKE, max(frequencies) * _ALIKE)) if frequencies else ()


def _nearest(exact: Sequence[RelayCycle], frequency: float) -> RelayCycle | None:
    """The exact cycle that a predicted one of this frequency (Hz) stands for."""
    alike = [one for one in exact if frequency / _ALIKE <= one.frequency <= frequency * _ALIKE]
    return min(alike, key=lambda one: abs(np.log(one.frequency / frequency)), default=None)


def _signals(balance: Balance, found: Oscillation) -> dict[str, float]:
    """The amplitude of every signal of the balance."""
    results = balance.results_of(found)
    reached = balance.system(found.s)[len(balance.arguments) :] @ results
    return dict(zip(balance.signals, np.abs(reached).tolist(), strict=True))


def _at_work(balance: Balance, found: Oscillation, gains: Sequence[np.ndarray], index: int) -> PieceAtWork:
    part, own = balance.parts[index], balance.places[index][0]
    single = gains[index].size == 1
    gain = complex(gains[index][0, 0]) if single else complex(np.nan, np.nan)
    neutral = _neutral(part)
    drives = None
    if neutral is not None:
        without = [np.full(N.shape, neutral) if k == index else N for k, N in enumerate(gains)]
        drives = bool(root_with_gains(balance, found, without).real < 0)
    size = float(np.abs(found.amplitude[own]).max())
    return PieceAtWork(part.name, size, abs(gain), float(np.angle(gain)) if single else np.nan, drives)


def _neutral(part: NonlinearPart) -> complex | None:
    """The gain of a piece that is not there: 1 of what is in a wire, 0 of a force; None of a block's own formulas."""
    if part.block is not None:
        return 1.0 if part.in_a_wire and len(part.arguments) == 1 else None
    return 0.0 if "@" in part.name else None
