"""Exact answers by other roads than `method_of_steps`: matrix exponentials, stacked intervals, quadrature.

Nothing here shares code with the simulator: event times are exact fractions, and the equations are typed a
second time, as matrices.
"""

from collections.abc import Callable
from fractions import Fraction
from functools import cache
from itertools import pairwise

import mpmath
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, expm

Array = NDArray[np.float64]
PERIOD = Fraction(5, 1000)
PHI, FIN, ROLL, TABLE, GYRO = 0, 1, 3, 4, 6     # places of the signals among the states of the roll bench


def ms(value: str) -> Fraction:
    """Milliseconds, written in decimals, as an exact fraction of a second."""
    return Fraction(value) / 1000


def companion(natural: float, damping: float) -> Array:
    """State matrix of wn^2 / (s^2 + 2 zeta wn s + wn^2), states output and its rate."""
    return np.array([[0.0, 1.0], [-(natural**2), -2 * damping * natural]])


def roll_matrix() -> Array:
    """Roll bench p03, its held inputs appended as constant states (8: sampled_rate, 9: fin angle wanted)."""
    plant = block_diag(0.0, companion(180.0, 0.6), -2.0, companion(400.0, 0.7), companion(377.0, 0.6))
    matrix = block_diag(plant, np.zeros((2, 2)))
    matrix[PHI, 8], matrix[FIN + 1, 9] = 1.0, 180.0**2
    matrix[ROLL, FIN], matrix[TABLE + 1, ROLL], matrix[GYRO + 1, TABLE] = 900.0, 400.0**2, 377.0**2
    return matrix


def demand(t: Fraction) -> float:
    """Doublet 5 deg, start 0.5 s, width 0.3 s."""
    if ms("500") <= t < ms("800"):
        return 5.0
    return -5.0 if ms("800") <= t < ms("1100") else 0.0


def exact_roll(
    *,
    table_delay: Fraction = Fraction(0),
    arrival: Callable[[Fraction], Fraction] = lambda tick: tick,
    shape: Callable[[float], float] = lambda u: u,
    rate_period: Fraction = PERIOD,
) -> dict[str, Array]:
    """Roll bench p03 over 2 s by matrix exponentials from event to event.

    A constant delay at the table's input commutes with table and gyro: both are run undelayed and read late.
    """
    rows = [ms("1") * k for k in range(2001)]
    rate_ticks = {rate_period * k for k in range(int(2 / rate_period) + 1)}
    ticks = [PERIOD * k for k in range(401)]
    arrivals = {arrival(tick): tick for tick in ticks}
    reads = {t - table_delay for t in (*rows, *rate_ticks) if t >= table_delay}
    events = sorted(t for t in {*rows, *rate_ticks, *ticks, *arrivals, *reads} if t <= 2)
    past: dict[Fraction, Array] = {}
    commands: dict[Fraction, float] = {}
    z, before, command, found = np.zeros(10), Fraction(0), 0.0, []
    for t in events:
        z = _roll_step(t - before) @ z
        past[t], before = z.copy(), t
        late = past[t - table_delay] if t - table_delay in past else np.zeros(10)
        if t in rate_ticks:
            z[8] = late[GYRO]
        if t % PERIOD == 0:
            command = commands[t] = 0.25 * (demand(t) - z[PHI]) - 0.045 * z[8]
        if t in arrivals:
            z[9] = shape(commands[arrivals[t]])
        if t % ms("1") == 0:
            sensors = late[TABLE], late[GYRO]
            found.append((demand(t), command, z[FIN], z[ROLL], *sensors, z[8], z[PHI], z[9], late[ROLL]))
    names = "roll_demand fin_command fin_position roll_rate table_rate sensed_rate sampled_rate roll_estimate"
    columns = np.array(found).T
    return dict(zip([*names.split(), "actuator_input", "table_input"], columns, strict=True))


@cache
def _roll_step(step: Fraction) -> Array:
    return expm(roll_matrix() * float(step))


def late_arrival(moment: Fraction) -> Fraction:
    """The root t of t - tau(t) = moment for tau = 15 ms + 3 ms sin(4 pi t), by fixed-point iteration."""
    t = float(moment)
    for _ in range(60):
        t = float(moment) + 0.015 + 0.003 * np.sin(4 * np.pi * t)
    return Fraction(round(t * 1e14), 10**14)


class _Modes:
    """exp(A t) x for many t, by the eigenvectors of A."""

    def __init__(self, matrix: Array) -> None:
        self.roots, self.vectors = np.linalg.eig(matrix)
        self.inverse = np.linalg.inv(self.vectors)

    def at(self, times: Array, x: Array) -> Array:
        """Row i: exp(A times[i]) x, or x[i] where x has rows."""
        parts = np.atleast_2d(x) @ self.inverse.T * np.exp(np.multiply.outer(times, self.roots))
        return np.real(parts @ self.vectors.T)


def varying_table() -> dict[str, Array]:
    """Roll bench p03 with 15 ms + 3 ms sin(4 pi t) at the table's input, at the ticks 0, 5 ms, ... 2 s.

    Fin and airframe are exact (held command); table and gyro by variation of constants, with Gauss-Legendre
    quadrature of roll_rate(t - tau(t)) between the arrivals of the ticks.
    """
    whole = roll_matrix()
    air = _Modes(whole[np.ix_([1, 2, 3, 9], [1, 2, 3, 9])])
    sensors = _Modes(whole[4:8, 4:8])
    nodes, weights = np.polynomial.legendre.leggauss(20)
    period, starts = float(PERIOD), np.zeros((402, 4))
    cuts = [float(late_arrival(PERIOD * k)) for k in range(401)]
    x, phi, found = np.zeros(4), 0.0, []
    for k in range(401):
        command = 0.25 * (demand(PERIOD * k) - phi) - 0.045 * x[2]
        found.append((command, starts[k][0], starts[k][2], x[0], x[2], phi))
        starts[k][3] = command
        phi += period * x[2]
        edges = [k * period, *(c for c in cuts if k * period < c < (k + 1) * period), (k + 1) * period]
        for a, b in pairwise(edges):
            times = (a + b) / 2 + (b - a) / 2 * nodes
            past = times - 0.015 - 0.003 * np.sin(4 * np.pi * times)
            origin = np.floor(past / period).astype(int)
            rolls = np.where(past > 0, air.at(past - origin * period, starts[origin])[..., 2], 0.0)
            pushes = np.outer(rolls, [0.0, 400.0**2, 0.0, 0.0])
            x = sensors.at(np.array([b - a]), x)[0] + weights * (b - a) / 2 @ sensors.at(b - times, pushes)
        starts[k + 1] = air.at(np.array([period]), starts[k])[0]
    names = ("fin_command", "fin_position", "roll_rate", "table_rate", "sensed_rate", "roll_estimate")
    return dict(zip(names, np.array(found).T, strict=True))


def stacked_loop(
    plant: tuple[Array, Array, Array], source: tuple[Array, Array], frames: int, count: int
) -> Array:
    """y at 1 ms rows of x' = A x + b e(t - tau), e = r - c x, tau = `frames` ms, over `count` delays.

    All intervals of length tau run side by side as one linear system without delay; r = g[0], g' = G g.
    """
    (a, b, c), (generator, g) = plant, source
    n, m = len(a), len(g)
    matrix = block_diag(*([a] * count), *([generator] * count))
    for k in range(1, count):
        matrix[k * n:(k + 1) * n, (k - 1) * n:k * n] = -np.outer(b, c)
        matrix[k * n:(k + 1) * n, count * n + (k - 1) * m] = b
    frame = expm(matrix * 1e-3)
    interval = np.linalg.matrix_power(frame, frames)
    z = np.zeros(len(matrix))
    z[count * n:] = np.concatenate([expm(generator * k * frames * 1e-3) @ g for k in range(count)])
    for k in range(1, count):
        z[k * n:(k + 1) * n] = (interval @ z)[(k - 1) * n:k * n]
    found = np.empty((frames, count))
    for row in range(frames):
        found[row] = z[:count * n].reshape(count, n) @ c
        z = frame @ z
    return found.T.ravel()


def rate_loop_plant(gain: float = 40.0) -> tuple[Array, Array, Array]:
    """K A(s) S(s) / s: actuator, sensor, integrator."""
    a = block_diag(companion(180.0, 0.6), companion(377.0, 0.6), 0.0)
    a[3, 0], a[4, 2] = 377.0**2, 1.0
    return a, np.array([0, gain * 180.0**2, 0, 0, 0]), np.array([0, 0, 0, 0, 1.0])


def resonance_plant() -> tuple[Array, Array, Array]:
    """3 * 14050 / ((s^2 + 17.86 s + 14050)(0.5 s + 1))."""
    a = np.array([[0, 1, 0], [-14050.0, -17.86, 0], [2.0, 0, -2.0]])
    return a, np.array([0, 3 * 14050.0, 0]), np.array([0, 0, 1.0])


def rate_loop_inverse(tau: str, t: float) -> float:
    """y(t) of the rate loop, K = 40, r = sin(2 pi 3 t): its Laplace transform inverted (de Hoog)."""
    with mpmath.workdps(40):
        w = 6 * mpmath.pi

        def answer(s: mpmath.mpc) -> mpmath.mpc:
            fin = 180**2 / (s**2 + 216 * s + 180**2)
            sensor = 377**2 / (s**2 + mpmath.mpf("452.4") * s + 377**2)
            loop = 40 * fin * sensor * mpmath.exp(-s * mpmath.mpf(tau)) / s
            return loop / (1 + loop) * w / (s**2 + w**2)

        return float(mpmath.invertlaplace(answer, t, method="dehoog", degree=80))


def turntable_by_radau(until: int) -> dict[str, Array]:
    """Turntable p09 with friction, by Radau (implicit, rtol 1e-12) from tick to tick; rows at 2 ms."""
    x, found = np.zeros(2), []
    for k in range(until + 1):
        t = k * 0.002
        reference = 20 * np.sin(np.pi * t)
        command = 0.9 * (reference - x[0]) - 0.06 * x[1]
        found.append((reference, command, *x))

        def rates(_: float, y: Array, u: float = command) -> list[float]:
            return [y[1], 400 * u - 8 * y[1] - 40 * np.tanh(y[1] / 0.2)]

        def slope(_: float, y: Array) -> list[list[float]]:
            return [[0.0, 1.0], [0.0, -8 - 200 / np.cosh(y[1] / 0.2) ** 2]]

        run = solve_ivp(rates, (0, 0.002), x, method="Radau", jac=slope, rtol=1e-12, atol=1e-12)
        x = run.y[:, -1]
    return dict(zip(("reference", "command", "position", "rate"), np.array(found).T, strict=True))
