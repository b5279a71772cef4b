"""Questions to a loop: margins against delay, characteristic roots, transfer between two signals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.characteristic_roots import rightmost_roots
from delaytools.analysis.delay_sweep import sweep_margins
from delaytools.analysis.gain_windows import GainWindows, stable_gains
from delaytools.analysis.jitter import JitterMargin, jitter_margin
from delaytools.analysis.margins import Labels, Margins, Sampling, margins
from delaytools.analysis.opened_loop import OpenedLoop, open_loop, scaled_transport
from delaytools.analysis.sampled_margins import sampled_margins, sampled_stable, sweep_sampled_margins
from delaytools.analysis.stability import closed_loop_of, roots_not_left
from delaytools.analysis.strong_stability import strong_stability
from delaytools.linear.algebra import delay, feedback
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.hold_approximation import continuous_approximation
from delaytools.linear.lifted import lift, why_not_liftable
from delaytools.linear.lifted_certificate import count_outside
from delaytools.loop.edit import disturbed_at
from delaytools.loop.linearise import linearise
from delaytools.loop.loop import Loop
from delaytools.loop.values import resolve
from delaytools.signals.trouble import AnalysisError

APPROXIMATE: Sampling = "continuous approximation"
SOME = 1.0  # s: γ(0) is the same for any delay


__all__ = [
    "Allowances", "LoopRoots", "MarginSweep", "RootSet", "loop_allowances", "loop_margins", "loop_roots", "transfer",
]  # fmt: skip


@final
@dataclass(frozen=True)
class MarginSweep:
    """Margins for every extra delay (s), and the intervals of delay inside the sweep in which the loop is stable.

    small_delays: in words, where arbitrarily small changes of delays flip the verdict; "" where none do.
    """

    margins: tuple[Margins, ...]
    stable_delays: tuple[tuple[float, float], ...]
    at: str
    delay_at: str | None
    why_approximate: str
    small_delays: str = ""


def loop_margins(
    loop: Loop, at: str, delays: Sequence[float] | None = None, *, delay_at: str | None = None
) -> MarginSweep:
    """Exact margins of the loop opened at the signal `at`, for every extra delay (s) at the port `delay_at`.

    L = -R, R the return ratio from the opened signal to its writer, all other loops closed. A sampled signal of a
    single-rate loop gives the exact pulse transfer up to π/T; elsewhere in a sampled loop (1 - e^{-sT})/(sT)
    stands for a hold, and the answer says so. Default delays: only 0. `delay_at` None: the delay stands at the
    opened signal itself.
    """
    wanted = [0.0] if delays is None else [float(tau) for tau in delays]
    _check_delays(wanted)
    opened = open_loop(loop, at, delay_at)
    if opened.opened.samplers and opened.exact_sampling:
        found, stable = _sampled_sweep(opened, wanted)
    else:
        found, stable = _continuous_sweep(opened, wanted)
    why = opened.why if opened.opened.samplers else ""
    return MarginSweep(found, stable, at, delay_at, why, _small_delays(opened, delay_at or at))


@final
@dataclass(frozen=True)
class Allowances:
    """What else a loop bears at one extra delay (s), besides its margins.

    gains: factors on the opened signal that leave it stable. jitter: what a delay at the extra one's place may vary by
    on top, |δ'| <= rate; None where the loop is not stable. jitter_sampling: of the jitter margin: its small gain knows
    holds as continuous ones alone. exact, approximate: margins of an exact sampled loop, and what the continuous
    approximation of its holds says instead; None elsewhere.
    """

    gains: GainWindows
    jitter: JitterMargin | None
    jitter_sampling: Sampling
    rate: float = np.inf
    exact: Margins | None = None
    approximate: Margins | None = None


def loop_allowances(
    loop: Loop, at: str, extra: float = 0.0, *, delay_at: str | None = None, rate: float = np.inf
) -> Allowances:
    """Intervals of gain, the jitter margin and what sampling is worth, of the loop opened at the signal `at`.

    extra: delay in s that is there, at the port `delay_at`. rate: by which a delay varies at most, s/s.
    """
    _check_delays([extra])
    opened = open_loop(loop, at, delay_at)
    exact = sampled_margins(opened.sampled(extra)) if opened.opened.samplers and opened.exact_sampling else None
    continuous = margins(opened.transfer(extra))
    stable_at = _stable_with(opened, extra)
    around = opened.around_extra() * delay(extra)  # what varies comes on top of the delay that is there
    return Allowances(
        stable_gains((exact or continuous).crossings, stable_at),
        jitter_margin(around, rate) if stable_at(1.0) else None,
        APPROXIMATE if opened.opened.samplers else "exact",
        rate, exact, continuous if exact is not None else None,
    )  # fmt: skip


def _stable_with(opened: OpenedLoop, extra: float) -> Callable[[float], bool]:
    """Whether the loop is stable with a factor on the opened signal, by a count of its roots."""
    if opened.opened.samplers and opened.exact_sampling:
        closed = opened.closed_at(extra)
        return lambda factor: sampled_stable(scaled_transport(closed, opened.closing, factor))
    L = opened.transfer(extra)
    return lambda factor: roots_not_left(closed_loop_of(L * factor)) == 0


def _small_delays(opened: OpenedLoop, place: str) -> str:
    """Where arbitrarily small changes of the loop's own delays, or an extra one at the place, flip the verdict."""
    own = strong_stability(continuous_approximation(opened.closed_at(0.0)))
    if not own.is_strong:
        return own.words
    more = strong_stability(continuous_approximation(opened.closed_at(SOME)))
    if more.is_strong:
        return ""
    return f"an extra delay at {place}, however small, makes the loop unstable: it comes back to itself directly, " \
        f"γ(0) = {more.gamma:.4g}, not below 1"


def _check_delays(delays: Sequence[float]) -> None:
    for tau in delays:
        if not (np.isfinite(tau) and tau >= 0):
            raise AnalysisError("an extra delay is finite and not negative", found=f"{tau} s")


def _sampled_sweep(
    opened: OpenedLoop, delays: list[float]
) -> tuple[tuple[Margins, ...], tuple[tuple[float, float], ...]]:
    labels = Labels("exact", opened.without)
    if delays == [0.0]:
        one = sampled_margins(opened.sampled(0.0), labels=labels)
        return (one,), (((0.0, 0.0),) if one.stable else ())
    return sweep_sampled_margins(opened.sampled, delays, labels)


def _continuous_sweep(
    opened: OpenedLoop, delays: list[float]
) -> tuple[tuple[Margins, ...], tuple[tuple[float, float], ...]]:
    labels = Labels(APPROXIMATE if opened.opened.samplers else "exact", opened.without)
    base = opened.transfer(0.0)
    if _in_series(opened, base):
        sweep = sweep_margins(base, delays, labels)
        return sweep.margins, sweep.stable_delays
    found = tuple(replace(margins(opened.transfer(tau), labels), delay=tau) for tau in delays)
    return found, sweep_margins(opened.around_extra(), delays).stable_delays


def _in_series(opened: OpenedLoop, base: DelaySystem) -> bool:
    """Whether L(s; τ) = L(s) e^{-sτ}: then gain crossovers do not move with τ."""
    tau = 0.01
    s = np.array([0.3 + 2j, 1.0 + 30j, 0.1 + 170j])
    return bool(
        np.allclose(opened.transfer(tau).siso(s), base.siso(s) * np.exp(-s * tau), rtol=1e-9, atol=1e-12)
    )


@final
@dataclass(frozen=True)
class RootSet:
    """The rightmost characteristic roots at one value of a parameter.

    parameter: extra delay in s, or the factor on the opened signal. roots: (k,) complex rad/s, rightmost first.
    certified: whether the number of roots right of `right_of` was confirmed by a count; why: in words where not.
    """

    parameter: float
    roots: NDArray[np.complex128]
    certified: bool
    right_of: float
    why: str


@final
@dataclass(frozen=True)
class LoopRoots:
    """Roots for every value of a parameter ("delay" or "gain"). small_delays: as in `MarginSweep`."""

    parameter: str
    sets: tuple[RootSet, ...]
    sampling: Sampling
    linearised_without: tuple[str, ...]
    small_delays: str = ""


def loop_roots(
    loop: Loop,
    at: str,
    *,
    delays: Sequence[float] | None = None,
    gains: Sequence[float] | None = None,
    delay_at: str | None = None,
    count: int = 10,
) -> LoopRoots:
    """The rightmost characteristic roots of the closed loop, for extra delays (s) or for factors on the signal `at`.

    Without sampled blocks: of the exact delay system, each set certified by a count. Sampled loops: s = ln(z)/T of
    the exact monodromy over the hyper-period, in the primary strip; where a delay lies inside a continuous loop,
    the continuous approximation. Raises AnalysisError where both delays and gains are given.
    """
    if delays is not None and gains is not None:
        raise AnalysisError("one parameter at a time", found="delays and gains", advice="give one of them")
    opened = open_loop(loop, at, delay_at)
    name, values = ("gain", list(gains)) if gains is not None else ("delay", list(delays or [0.0]))
    _check_delays(values if name == "delay" else [0.0])
    exact = not opened.opened.samplers or not why_not_liftable(opened.closed_at(0.0))
    if opened.opened.samplers and exact:
        sets = tuple(_sampled_roots(opened, name, value, count) for value in values)
    else:
        sets = tuple(_continuous_roots(opened, name, value, count) for value in values)
    sampling = "exact" if exact else APPROXIMATE
    return LoopRoots(name, sets, sampling, opened.without, _small_delays(opened, delay_at or at))


def _continuous_roots(opened: OpenedLoop, name: str, value: float, count: int) -> RootSet:
    if name == "gain":
        closed = feedback(opened.transfer(0.0) * value)
    else:
        closed = continuous_approximation(opened.closed_at(value))
    found = rightmost_roots(closed, count=count)
    return RootSet(value, found.roots[:count], found.certified, found.right_of, found.why)


def _sampled_roots(opened: OpenedLoop, name: str, value: float, count: int) -> RootSet:
    system = opened.closed_at(0.0) if name == "gain" else opened.closed_at(value)
    if name == "gain":
        system = scaled_transport(system, opened.closing, value)
    lifted = lift(system)
    assert lifted is not None
    roots = lifted.roots()
    order = np.lexsort((-np.abs(roots.imag), -roots.real))
    roots = roots[order]
    why = _certificate(lifted.monodromy, int(np.sum(np.abs(lifted.multipliers) > 1.0)))
    line = float(roots[-1].real) if len(roots) else -np.inf
    return RootSet(value, roots[:count], not why, line, why)


def _certificate(monodromy: NDArray[np.float64], outside: int) -> str:
    """Why the count on the unit circle does not confirm the eigenvalues ("" where it does)."""
    try:
        counted = count_outside(monodromy)
    except AnalysisError as error:
        return error.problem
    return "" if counted == outside else f"{outside} eigenvalues outside the unit circle, {counted} counted"


def transfer(loop: Loop, input: str, output: str) -> DelaySystem:
    """The closed loop's transfer between two signals, all loops closed; holds as their continuous approximation.

    input: an external input, or any signal, to which a disturbance is then added behind its writer.
    Raises DesignError for an unknown signal.
    """
    if input in resolve(loop).externals:
        return continuous_approximation(linearise(loop, [input], [output]).system)
    disturbed, name = disturbed_at(loop, input)
    return continuous_approximation(linearise(disturbed, [name], [output]).system)

