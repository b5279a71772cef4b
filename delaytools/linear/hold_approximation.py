"""Sampled blocks as continuous ones: C(e^{sT}) exactly, and a hold where a continuous block reads it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from delaytools.linear.channel import Channel, Delay, Hold
from delaytools.linear.delay_system import DelaySystem
from delaytools.linear.matrices import RealMatrix
from delaytools.linear.sampled_system import Row, SampledSystem, Sampler

__all__ = ["continuous_approximation"]

Mask = NDArray[np.bool_]
_INTERNAL = ("q", "v", "xi", "held", "raw", "through_hold", "plain")


def continuous_approximation(sampled: SampledSystem) -> DelaySystem:
    """The system with e^{sT} for each sampler's step and (1 - e^{-sT})/(sT) for each hold that is read.

    xi = e^{-sT}(F xi + G q);  v = H xi + D q;  held v = v (1 - e^{-sT})/(sT)
    Rows q read v as it is (a sequence); rows x' and y read it held. A transport that only carries held
    signals is read raw by rows q and held by the others; a transport that mixes in x or e carries held
    signals. An output made of v alone is a sequence, without hold. Aliasing is neglected: it holds for
    frequencies well below pi/T. Without samplers it is exact. Raises AnalysisError where a loop without
    delay among the sampled blocks is singular.
    """
    wiring = _Wiring(sampled, _purely_held(sampled))
    channels = wiring.channels()
    z = np.vstack([wiring.row(name) for name in _INTERNAL])
    x, y = wiring.continuous_row("x"), wiring.outputs_row()
    n, m, nu = sampled.n_states, len(channels), len(sampled.inputs)
    cut = [n, n + m]
    A, B2, B1 = np.split(x, cut, axis=1)
    C2, D22, D21 = np.split(z, cut, axis=1)
    C1, D12, D11 = np.split(y, cut, axis=1)
    whole = DelaySystem(
        A=A, B1=B1.reshape(n, nu), B2=B2, C1=C1, C2=C2, D11=D11.reshape(len(y), nu), D12=D12, D21=D21, D22=D22,
        channels=channels, inputs=sampled.inputs, outputs=sampled.outputs,
    )  # fmt: skip
    return _without_unread(whole).without_zero_delays()


def _purely_held(sampled: SampledSystem) -> Mask:
    """Which transports carry held signals only: their z rows read v and other such transports, no x, no e."""
    if not sampled.samplers:
        return np.zeros(sampled.n_transports, dtype=bool)
    pure = ~np.any(sampled.block("z", "x"), axis=1) & ~np.any(sampled.block("z", "e"), axis=1)
    transports = sampled.block("z", "w") != 0
    for _ in range(len(pure)):
        pure = pure & ~np.any(transports & ~pure[None, :], axis=1)
    return pure


@final
@dataclass(frozen=True, eq=False)
class _Wiring:
    """Rows over the columns [x, internal signals, e]; the internal signals are the channels, in order.

    q and v are channels of no delay; xi the samplers' states; raw and through_hold the two readings of the
    purely held transports; plain the other transports.
    """

    sampled: SampledSystem
    pure: Mask

    def sizes(self) -> dict[str, int]:
        s, pure = self.sampled, int(self.pure.sum())
        return {
            "x": s.n_states, "q": s.n_sampled_inputs, "v": s.n_sampled_outputs,
            "xi": sum(sampler.n_states for sampler in s.samplers), "held": s.n_sampled_outputs,
            "raw": pure, "through_hold": pure, "plain": s.n_transports - pure, "e": len(s.inputs),
        }  # fmt: skip

    def channels(self) -> tuple[Channel, ...]:
        s = self.sampled
        delays = np.array(s.delays)
        pure, plain = ([Delay(float(tau)) for tau in delays[mask]] for mask in (self.pure, ~self.pure))
        instant: list[Channel] = [Delay(0.0)] * (s.n_sampled_inputs + s.n_sampled_outputs)
        steps = [Delay(sampler.period) for sampler in s.samplers for _ in range(sampler.n_states)]
        holds = [Hold(sampler.period) for sampler in s.samplers for _ in range(sampler.n_outputs)]
        return tuple([*instant, *steps, *holds, *pure, *pure, *plain])

    def row(self, name: str) -> RealMatrix:
        """The rows z of the internal signal `name`."""
        samplers = self.sampled.samplers
        return {
            "q": lambda: self._rows("q", v="v", w="raw"),
            "v": lambda: self._placed({"xi": _joined(samplers, "H"), "q": _joined(samplers, "D")}),
            "xi": lambda: self._placed({"xi": _joined(samplers, "F"), "q": _joined(samplers, "G")}),
            "held": lambda: self._placed({"v": np.eye(self.sampled.n_sampled_outputs)}),
            "raw": lambda: self._rows("z", v="v", w="raw")[self.pure],
            "through_hold": lambda: self.continuous_row("z")[self.pure],
            "plain": lambda: self.continuous_row("z")[~self.pure],
        }[name]()

    def continuous_row(self, row: Row) -> RealMatrix:
        """Rows as a continuous block reads: every held signal through its hold."""
        return self._rows(row, v="held", w="through_hold")

    def outputs_row(self) -> RealMatrix:
        """Rows y: a sequence (v alone) as it is, anything else as a continuous block reads."""
        s = self.sampled
        sequence = ~np.any(np.hstack([s.block("y", "x"), s.block("y", "w"), s.block("y", "e")]), axis=1)
        return np.where(sequence[:, None], self._rows("y", v="v", w="raw"), self.continuous_row("y"))

    def _rows(self, row: Row, *, v: str, w: str) -> RealMatrix:
        s = self.sampled
        transports = s.block(row, "w")
        return self._placed(
            {
                "x": s.block(row, "x"), v: s.block(row, "v"), w: transports[:, self.pure],
                "plain": transports[:, ~self.pure], "e": s.block(row, "e"),
            }
        )  # fmt: skip

    def _placed(self, parts: dict[str, RealMatrix]) -> RealMatrix:
        rows = next(iter(parts.values())).shape[0]
        return np.hstack([parts.get(name, np.zeros((rows, size))) for name, size in self.sizes().items()])


def _joined(samplers: tuple[Sampler, ...], name: str) -> RealMatrix:
    pick: Callable[[Sampler], RealMatrix] = lambda sampler: getattr(sampler, name)  # noqa: E731
    return np.asarray(block_diag(*(pick(sampler) for sampler in samplers))) if samplers else np.zeros((0, 0))


def _without_unread(system: DelaySystem) -> DelaySystem:
    """The system without the channels that nothing reads; they add no root."""
    while True:
        read = np.any(np.vstack([system.B2, system.D12, system.D22]), axis=0)
        if read.all():
            return system
        system = system.with_channels([int(index) for index in np.flatnonzero(read)])
