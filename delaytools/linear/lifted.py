"""The exact discrete model of a sampled loop with transports, over the period after which all ticks repeat."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.linear.lifted_paths import Expansion, delay_free_blocks, expanded
from delaytools.linear.lifted_steps import Clock, Layout, clock_of, flow, jump, layout_of
from delaytools.linear.matrices import RealMatrix
from delaytools.linear.sampled_system import SampledSystem
from delaytools.signals.trouble import AnalysisError

__all__ = ["LiftedSystem", "lift", "why_not_liftable"]


@final
@dataclass(frozen=True, eq=False)
class LiftedSystem:
    """X[k+1] = Φ X[k] + Γ e[k];  y[k] = C X[k] + D e[k] at t = k·period, just after the ticks; exact.

    monodromy Φ (N,N); input_matrix Γ (N,ne), e the held inputs; output_matrix C (ny,N); feedthrough D (ny,ne).
    Where the held inputs tick more often than the period, Γ is left empty (the loop is not time-invariant).
    Φ's non-zero eigenvalues z are e^{s·period} for the characteristic roots s (Floquet multipliers).
    """

    period: float
    monodromy: RealMatrix
    input_matrix: RealMatrix
    output_matrix: RealMatrix
    feedthrough: RealMatrix

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """The eigenvalues z of Φ, largest modulus first."""
        values = np.linalg.eigvals(self.monodromy).astype(complex)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def spectral_radius(self) -> float:
        """The largest |z|: the loop is stable where it is below 1."""
        return float(np.abs(self.multipliers[0])) if self.multipliers.size else 0.0

    def roots(self, *, smallest: float = 1e-6) -> NDArray[np.complex128]:
        """s = log(z) / period in rad/s, rightmost first, for |z| >= `smallest` (z = 0 is no root).

        The imaginary part is known up to multiples of 2π/period; the principal one is given.
        """
        kept = self.multipliers[np.abs(self.multipliers) >= smallest]
        return np.asarray(np.log(kept) / self.period, dtype=complex)

    def pulse(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """C (zI - Φ)⁻¹ Γ + D at z = e^{jω·period}: (nω, ny, ne) for ω (nω,) in rad/s."""
        z = np.exp(1j * self.period * np.asarray(frequency, dtype=float))
        identity = np.eye(len(self.monodromy))
        shifted = z[:, None, None] * identity - self.monodromy
        reached = np.linalg.solve(shifted, self.input_matrix[None])
        return np.asarray(self.output_matrix @ reached + self.feedthrough, dtype=complex)


def why_not_liftable(sampled: SampledSystem, held: Mapping[str, float] | None = None) -> str:
    """Why there is no exact discrete model of `sampled`; empty where there is one."""
    prepared = _prepared(sampled, dict(held or {}))
    return prepared if isinstance(prepared, str) else ""


def lift(sampled: SampledSystem, held: Mapping[str, float] | None = None) -> LiftedSystem | None:
    """The exact discrete model of `sampled`; None where `why_not_liftable` says why.

    held: {input name: period in s} of the inputs that are sequences, updated at 0, T, 2T, ...; other inputs
    are left out. Every state is in Φ, so that hidden modes count.
    Method: transports are pushed in front of the continuous states (lifted_paths), the state is composed from
    exact flows and jumps over the hyper-period (lifted_steps), and restricted to consistent delayed copies.
    Raises AnalysisError for an algebraic loop or an unknown input.
    """
    prepared = _prepared(sampled, dict(held or {}))
    if isinstance(prepared, str):
        return None
    expansion, clock = prepared
    layout = layout_of(sampled, expansion, clock)
    before, given, invariant = _cycle(layout)
    kept, spread = _consistent(layout)
    outputs = np.zeros((expansion.Cy.shape[0], layout.size))
    outputs[:, : len(expansion.copies)] = expansion.Cy
    for place, column in zip(layout.places(0.0, 0.0), expansion.Dy.T, strict=True):
        outputs[:, place] += column
    step, given = before @ spread, given if invariant else np.zeros((layout.size, 0))
    return LiftedSystem(clock.hyper_period, step[kept], given[kept], outputs @ step, outputs @ given)


def _prepared(sampled: SampledSystem, held: dict[str, float]) -> tuple[Expansion, Clock] | str:
    for name in held:
        if name not in sampled.inputs:
            raise AnalysisError("no such input", found=repr(name), known=sampled.inputs)
    periods = [s.period for s in sampled.samplers for _ in range(s.n_outputs)] + list(held.values())
    if not periods:
        return "no sampled block"
    clock = clock_of(periods)
    if clock is None:
        return "the sampling periods have no common multiple within 1000 ticks"
    expansion = expanded(delay_free_blocks(sampled, [sampled.inputs.index(name) for name in held]))
    return expansion if isinstance(expansion, str) else (expansion, clock)


def _cycle(layout: Layout) -> tuple[RealMatrix, RealMatrix, bool]:
    """The map from just after the ticks at 0 to just after those one hyper-period later, and e's share."""
    clock = layout.clock
    ticks = sorted(t for p in set(clock.periods) for t in np.arange(p, clock.hyper_period + 0.5 * p, p))
    merged = [0.0]
    for tick in ticks:
        if tick - merged[-1] > clock.merge:
            merged.append(float(tick))
    total, given, shares = np.eye(layout.size), np.zeros((layout.size, 0)), 0
    for first, last in pairwise(merged):
        step, given = jump(layout, last)
        shares += bool(given.any())
        total = step @ flow(layout, first, last - first) @ total
    return total, given, shares <= 1


def _consistent(layout: Layout) -> tuple[list[int], RealMatrix]:
    """The places kept, and the map from them to the whole state just after the ticks at 0.

    Of several copies x_j(t - lag) only the latest-lagging is free; the others follow from it by running the
    known held values on: x_j(t - r) = x_j((t + L - r) - L). Without this, each duplicate would add spurious
    eigenvalues e^{λT} of its own.
    """
    copies = layout.expansion.copies
    longest: dict[int, float] = {}
    for j, lag in copies:
        longest[j] = max(lag, longest.get(j, 0.0))
    dropped = [i for i, (j, lag) in enumerate(copies) if lag < longest[j]]
    kept = [i for i in range(layout.size) if i not in set(dropped)]
    spread = np.zeros((layout.size, len(kept)))
    spread[kept] = np.eye(len(kept))
    flows: dict[float, RealMatrix] = {}
    for i in sorted(dropped, key=lambda i: -longest[copies[i][0]]):
        j, lag = copies[i]
        ahead = longest[j] - lag
        if ahead not in flows:
            flows[ahead] = flow(layout, 0.0, ahead)
        spread[i] = flows[ahead][copies.index((j, longest[j]))] @ spread
    return kept, spread
