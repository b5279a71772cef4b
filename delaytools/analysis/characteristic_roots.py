"""Characteristic roots of a linear system with delay: the rightmost ones, counted, for one or many delays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.analysis.root_bounds import Box, enclosing_box, shifted_loop
from delaytools.analysis.root_collocation import collocation_sizes, collocation_spectrum
from delaytools.analysis.root_contour import counted_in
from delaytools.analysis.root_newton import distinct, newton
from delaytools.analysis.root_sets import gap_left_of, mirrored, sorted_roots, with_multiplicity
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.matrices import RealMatrix
from delaytools.signals.trouble import AnalysisError

__all__ = ["CharacteristicRoots", "RootCount", "rightmost_roots", "roots_over_delays", "unstable_count"]

ComplexArray = NDArray[np.complex128]
_REFINEMENTS = (1.0, 2.0, 4.0)
_SHIFTS_OFF_ROOTS = (1e-8, 1e-7, 1e-6, 1e-5)  # of the modulus typical of the system


@final
@dataclass(frozen=True, eq=False)
class CharacteristicRoots:
    """The characteristic roots right of a line.

    roots: complex (k,), rad/s, by decreasing real part, both of a pair, a multiple root repeated;
    residuals: (k,) the size of one more Newton step, rad/s; right_of: the set is complete for Re s > right_of
    and |Im s| <= up_to (inf where nothing can lie beyond); counted: the number of roots there by the argument
    principle; certified: counted and found agree; why: in words, what limits the answer (empty otherwise).
    """

    roots: ComplexArray
    residuals: RealMatrix
    right_of: float
    up_to: float
    counted: int
    certified: bool
    why: str = ""


@final
@dataclass(frozen=True)
class RootCount:
    """count: roots with Re s > 0; on_axis: roots on the imaginary axis; certified and why as for the roots."""

    count: int
    on_axis: int
    certified: bool
    why: str = ""


def rightmost_roots(
    system: DelaySystem, *, right_of: float | None = None, count: int = 10, up_to: float | None = None
) -> CharacteristicRoots:
    """All characteristic roots, det M(s) = 0, with Re s > right_of (rad/s), and their certificate.

    right_of: by default left of the rightmost `count` roots. up_to: a bound of |Im s|, rad/s; only where
    infinite chains of roots (neutral systems) may reach right of the line is there one by default.
    A line through a root is moved a little to the left, which `why` then says. A root that was counted but
    not found is reported: certified is False. Raises AnalysisError where right_of is too far left to compute.
    Source: collocation after Breda, Maset & Vermiglio (2005); argument principle with proven steps.
    """
    system = system.without_zero_delays()
    if not system.channels:
        return _eigenvalues(system, right_of)
    spans = np.array([system.delays]).reshape(1, system.n_channels)
    line = _default_line(system, spans, count, up_to) if right_of is None else float(right_of)
    answer = _roots_right_of(system, spans, line, up_to)[0]
    for shift in _SHIFTS_OFF_ROOTS:
        if answer is not None:
            break
        moved = line - shift * _scale(system, spans, line)
        answer = _roots_right_of(system, spans, moved, up_to)[0]
        if answer is not None:
            words = f"a root lies on the line Re s = {line:g}; it was moved to {moved:.9g}"
            answer = replace(answer, why="; ".join(filter(None, [words, answer.why])))
    return answer or _uncounted(system, spans, line, up_to)


def roots_over_delays(
    system: DelaySystem, channels: Sequence[int] | int | None, delays: Sequence[float], *,
    right_of: float | None = None, count: int = 10,
) -> list[CharacteristicRoots]:  # fmt: skip
    """`rightmost_roots` for each of many delays (s) of the given channels (indices; None: all channels).

    With `right_of` all delays are computed together. Raises AnalysisError for an unknown channel.
    """
    spans = _swept(system, channels, delays)
    answers: list[CharacteristicRoots | None] = [None] * len(spans)
    if right_of is not None:
        together = np.flatnonzero(np.all(spans > 0, axis=1))
        found = _roots_right_of(system, spans[together], float(right_of), None) if len(together) else []
        for index, answer in zip(together, found, strict=True):
            answers[index] = answer
    return [
        rightmost_roots(system.with_spans(list(row)), right_of=right_of, count=count)
        if answer is None or not answer.certified
        else answer
        for row, answer in zip(spans, answers, strict=True)
    ]


def unstable_count(system: DelaySystem, *, up_to: float | None = None) -> RootCount:
    """The exact number of roots with Re s > 0, and of those on the imaginary axis, without computing any.

    N by the argument principle on Re s = 0; where roots lie on the axis, on two lines beside it.
    """
    system = system.without_zero_delays()
    spans = np.array([system.delays]).reshape(1, system.n_channels)
    number, box = _count(system, spans, 0.0, up_to)
    if number is not None:
        return RootCount(number, 0, True, _limits(box))
    for shift in _SHIFTS_OFF_ROOTS:
        aside = shift * _scale(system, spans, 0.0)
        right, _ = _count(system, spans, aside, up_to)
        left, box = _count(system, spans, -aside, up_to)
        if right is not None and left is not None:
            words = f"roots within {aside:.1e} rad/s of the imaginary axis are taken to be on it"
            return RootCount(right, left - right, True, "; ".join(filter(None, [words, _limits(box)])))
    return RootCount(0, 0, False, "roots crowd at the imaginary axis: no line beside it could be counted on")


def _eigenvalues(system: DelaySystem, right_of: float | None) -> CharacteristicRoots:
    """The roots of a system without delay: all of them, or those right of the line."""
    line = -np.inf if right_of is None else float(right_of)
    roots = np.linalg.eigvals(system.A).astype(complex)
    roots = roots[roots.real > line]
    roots = roots[np.lexsort((-roots.imag, np.abs(roots.imag), -roots.real))]
    return CharacteristicRoots(roots, np.zeros(len(roots)), line, np.inf, len(roots), True)


def _roots_right_of(
    system: DelaySystem, spans: RealMatrix, line: float, up_to: float | None
) -> list[CharacteristicRoots | None]:
    """Roots for each row of `spans`; None where the line meets a root."""
    box = enclosing_box(system, spans, line, up_to=up_to)
    counts = counted_in(system, spans, box)
    answers: list[CharacteristicRoots | None] = [None] * len(spans)
    missing = np.flatnonzero(counts.reached)
    for finer in _REFINEMENTS:
        if not len(missing):
            break
        found = _searched(system, spans[missing], box, counts.numbers[missing], finer=finer)
        for index, (roots, residuals) in zip(missing, found, strict=True):
            answers[index] = _recorded(roots, residuals, box, int(counts.numbers[index]))
        missing = np.flatnonzero([wanted is not None and not wanted.certified for wanted in answers])
    return answers


def _searched(
    system: DelaySystem, spans: RealMatrix, box: Box, numbers: NDArray[np.int64], *, finer: float
) -> list[tuple[ComplexArray, RealMatrix]]:
    """The distinct roots in the box, or with multiplicity where fewer than `numbers` are distinct."""
    frequency = _frequency(system, spans, box, int(numbers.max())) * finer
    sizes = collocation_sizes(spans, frequency, system.n_states)
    spectrum = collocation_spectrum(system, spans, sizes)
    margin = 0.5 / (spans.max(initial=0.0) or np.inf) + 0.02 * np.abs(spectrum)
    near = (spectrum.imag >= 0) & (spectrum.real > box.left - margin) & (spectrum.real < box.right + margin)
    near &= spectrum.imag < 1.1 * box.top
    owner, guesses = np.nonzero(near)[0], spectrum[near]
    if finer > 1.0:  # two real roots may have been guessed as a pair
        pair = guesses.imag > 0
        beside = [guesses[pair].real + sign * guesses[pair].imag + 0j for sign in (-1.0, 1.0)]
        guesses = np.concatenate([guesses, *beside])
        owner = np.concatenate([owner, owner[pair], owner[pair]])
    roots, steps = newton(system, guesses, spans[owner])
    answers = []
    for index, number in enumerate(numbers):
        mine = owner == index
        kept = sorted_roots(roots[mine], steps[mine], box)
        if len(kept[0]) != number and finer > 1.0:
            kept = with_multiplicity(system.with_spans(list(spans[index])), kept, box)
        answers.append(kept)
    return answers


def _recorded(roots: ComplexArray, residuals: RealMatrix, box: Box, counted: int) -> CharacteristicRoots:
    agreed = len(roots) == counted
    words = "" if agreed else f"{counted} roots were counted and {len(roots)} found: the set is not complete"
    why = "; ".join(filter(None, [words, _limits(box)]))
    up_to = np.inf if box.complete else box.top
    return CharacteristicRoots(roots, residuals, box.left, up_to, counted, agreed, why)


def _uncounted(
    system: DelaySystem, spans: RealMatrix, line: float, up_to: float | None
) -> CharacteristicRoots:
    """What collocation and Newton find where no line could be counted on: never certified."""
    box = enclosing_box(system, spans, line, up_to=up_to)
    roots, residuals = _searched(system, spans, box, np.array([10]), finer=1.0)[0]
    words = f"roots crowd at the line Re s = {line:g}: no count was possible, roots may be missing"
    up_to = np.inf if box.complete else box.top
    return CharacteristicRoots(roots, residuals, line, up_to, -1, False, words)


def _default_line(system: DelaySystem, spans: RealMatrix, count: int, up_to: float | None) -> float:
    """A line in a gap of the spectrum, left of the rightmost `count` roots as collocation sees them."""
    if count < 1:
        raise AnalysisError("ask for one root or more", found=f"count = {count}")
    roots = np.zeros(0, dtype=complex)
    for finer in _REFINEMENTS:
        roots = _rightmost_seen(system, spans, int(finer * (count + 4)), up_to)
        if len(roots) > count:
            break
    return gap_left_of(roots, count)


def _rightmost_seen(system: DelaySystem, spans: RealMatrix, number: int, up_to: float | None) -> ComplexArray:
    """About `number` of the rightmost roots as collocation and Newton see them, nothing counted."""
    poles = np.abs(shifted_loop(system, 0.0).poles).max(initial=0.0)
    sizes = collocation_sizes(spans, poles + np.pi * number / spans.max(), system.n_states)
    guesses = collocation_spectrum(system, spans, sizes)[0]
    guesses = guesses[(guesses.imag >= 0) & (guesses.imag <= (np.inf if up_to is None else up_to))]
    guesses = guesses[np.argsort(-guesses.real)][: number + 6]
    roots, steps = newton(system, guesses, np.repeat(spans, len(guesses), axis=0))
    converged = steps < 1e-6 * (1e-6 + np.abs(roots))
    roots, steps = roots[converged], steps[converged]
    real = np.abs(roots.imag) < 1e-9 * np.abs(roots)
    roots = np.where(real, roots.real, roots.real + 1j * np.abs(roots.imag))
    return mirrored(roots[distinct(roots, steps, 1e-7 * (1e-6 + np.abs(roots)))])


def _count(
    system: DelaySystem, spans: RealMatrix, line: float, up_to: float | None
) -> tuple[int | None, Box]:
    box = enclosing_box(system, spans, line, up_to=up_to)
    counts = counted_in(system, spans, box)
    return (int(counts.numbers[0]) if counts.reached[0] else None), box


def _frequency(system: DelaySystem, spans: RealMatrix, box: Box, number: int) -> float:
    """A modulus (rad/s) up to which `number` roots are expected: one chain, besides the modes without delay."""
    longest = spans.max(initial=0.0)
    chain = np.pi * number / longest if longest else 0.0
    return float(
        min(
            np.hypot(box.top, box.left), chain + np.abs(shifted_loop(system, box.left).poles).max(initial=0.0)
        )
    )


def _limits(box: Box) -> str:
    if box.complete:
        return ""
    return f"roots are counted up to |Im s| = {box.top:.4g} rad/s only: chains of roots may go on beyond it"


def _scale(system: DelaySystem, spans: RealMatrix, line: float) -> float:
    """A modulus of s typical of the system, rad/s."""
    modes = np.abs(shifted_loop(system, line).poles).max(initial=0.0)
    longest = spans.max(initial=0.0)
    return float(max(modes, abs(line), 1.0 / longest if longest else 0.0)) or 1.0


def _swept(system: DelaySystem, channels: Sequence[int] | int | None, delays: Sequence[float]) -> RealMatrix:
    """One row of spans per delay, the chosen channels set to it."""
    every = range(system.n_channels)
    chosen = list(every) if channels is None else [channels] if isinstance(channels, int) else list(channels)
    if any(index not in every for index in chosen):
        raise AnalysisError("no such channel", found=str(chosen), known=[str(index) for index in every])
    values = np.asarray(delays, dtype=float)
    if values.ndim != 1 or not np.all(np.isfinite(values) & (values >= 0)):
        raise AnalysisError("delays must be a list of finite seconds, not negative", found=str(delays))
    spans = np.tile(np.array(system.delays, dtype=float), (len(values), 1))
    spans[:, chosen] = values[:, None]
    return spans
