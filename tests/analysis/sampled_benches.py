"""Sampled loops for the tests: the roll bench p03 by its numbers, and small ones with known answers."""

import numpy as np

from delaytools.analysis.sampled_margins import SampledLoop
from delaytools.linear.sampled_system import SampledSystem, Sampler

T = 0.005
STATES = ("roll", "fin", "fin_rate", "roll_rate", "table", "table_rate", "gyro", "gyro_rate")


def holder(period: float, gain: float = 1.0) -> Sampler:
    """A sampled gain without states."""
    return Sampler(period, np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[gain]])


def roll_bench(
    delays: dict[str, float] | None = None, *, opened: bool = False, autopilot: float = T
) -> SampledSystem:
    """The practice bench p03: v = (sampled_rate, fin_command), delays at "table" and "fin" (their inputs).

    Opened: the actuator reads the input e instead of fin_command; y is fin_command in both.
    """
    delays = delays or {}
    names = [name for name in ("table", "fin") if name in delays]
    nx, nz = 8, len(names)
    v, w, e, q, y = nx, nx + 2, nx + 2 + nz, nx + nz, nx + nz + 2
    M = np.zeros((nx + nz + 3, nx + 2 + nz + 1))

    def read(row: int, column: int, gain: float, name: str) -> None:
        if name in names:
            M[nx + names.index(name), column] = 1.0
            column = w + names.index(name)
        M[row, column] += gain

    M[0, v] = 1.0
    for at, (wn, zeta) in ((1, (180.0, 0.6)), (4, (400.0, 0.7)), (6, (377.0, 0.6))):
        M[at, at + 1] = 1.0
        M[at + 1, [at, at + 1]] = -(wn**2), -2 * zeta * wn
    read(2, e if opened else v + 1, 180.0**2, "fin")
    M[3, [3, 1]] = -2.0, 900.0
    read(5, 3, 400.0**2, "table")
    M[7, 4] = 377.0**2
    M[q, 6] = 1.0
    M[q + 1, [0, v]] = -0.25, -0.045
    M[y, v + 1] = 1.0
    samplers = (holder(T), holder(autopilot))
    return SampledSystem(M, nx, tuple(delays[name] for name in names), samplers, ("e",), ("y",), STATES)


def roll_loop(table: float) -> SampledLoop:
    """p03 opened at fin_command with `table` s at motion_table.input."""
    return SampledLoop(
        roll_bench({"table": table}, opened=True),
        "e",
        T,
        lambda tau: roll_bench({"table": table, "fin": tau}),
    )


def integrator_loop(delays: tuple[float, ...], gains: tuple[float, ...], period: float) -> SampledSystem:
    """x' = v;  v = -Σ g_i x(t - τ_i), sampled and held."""
    n = len(delays)
    M = np.zeros((1 + n + 1, 1 + 1 + n))
    M[0, 1] = 1.0
    M[1 : 1 + n, 0] = 1.0
    M[1 + n, 2:] = -np.array(gains)
    return SampledSystem(M, 1, delays, (holder(period),), (), (), ("x",))
