"""A continuous block for all lanes: exact where it is linear, Bogacki-Shampine steps where forces act inside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.forces import Forces
from benchmarks.hidden_effects.linear import Exact
from benchmarks.hidden_effects.wave import Clock, Wave

Array = np.ndarray
LARGEST_STIFF_STEP = 0.8  # step times friction slope
COARSE_STIFF_STEP = 1.8  # while sizes are searched; the formula is stable up to 2.5
COARSE = 0.9e-3  # s
MOST_SUBSTEPS = 24


@dataclass(frozen=True)
class ForcePort:
    """A derivative where forces act: its own state, and the state that is its position (None: it has none)."""

    state: int
    position: int | None


class ForcedLanes:
    """The lanes in which something acts on a derivative or limits the rate."""

    def __init__(
        self, A: Array, B: Array, step: float, ports: Mapping[str, ForcePort], acts: Sequence
    ) -> None:
        self.step = step
        size = B.shape[1]
        entries = [(i, k, A[:, i, k]) for i in range(size) for k in range(size)]
        entries += [(i, None, B[:, i]) for i in range(size)]
        self.terms = [entry for entry in entries if entry[2].any()]
        self.state = np.zeros((A.shape[1], len(B)))
        self.acts = acts
        smoothing = np.array([lane.smoothing for lane in acts])
        self.forces = {
            port: (place, Forces([lane.at(port) for lane in acts], smoothing))
            for port, place in ports.items()
        }
        self.limit = np.array([lane.rate_limit for lane in acts])
        self.limited = bool(np.isfinite(self.limit).any())
        self.fresh = True
        self.substeps = 1

    def rates(self, x: Array, u: Array, cross: Mapping[str, Array]) -> Array:
        """Derivatives of the states."""
        out = np.zeros_like(x)
        for i, k, weight in self.terms:
            out[i] += weight * (u if k is None else x[k])
        for port, (place, forces) in self.forces.items():
            v = x[place.state]
            position = v if place.position is None else x[place.position]
            out[place.state] = forces.total(position, v, out[place.state] + cross.get(port, 0.0))
        if self.limited:
            v = x[1]
            out[0] = np.clip(v, -self.limit, self.limit)
            outwards = (np.abs(v) >= self.limit) & (out[1] * v > 0)
            out[1] = np.where(outwards, 0.0, out[1])
        return out

    def run(self, a: Array, b: Array, cross: Mapping[str, tuple[Array, Array]]) -> Array:
        """States at the start, and after every step."""
        if self.fresh:
            largest = COARSE_STIFF_STEP if self.step > COARSE else LARGEST_STIFF_STEP
            slope = max((f.stiffness() for _, f in self.forces.values()), default=0.0)
            self.substeps = int(np.clip(np.ceil(slope * self.step / largest), 1, MOST_SUBSTEPS))
            self.fresh = False
        path = [self.state]
        x = self.state
        for j in range(len(a)):
            for part in range(self.substeps):
                lo, hi = part / self.substeps, (part + 1) / self.substeps
                x = self._step(
                    x,
                    _line(a[j], b[j], lo, hi),
                    {k: _line(p[j], q[j], lo, hi) for k, (p, q) in cross.items()},
                )
            path.append(x)
        self.state = x
        return np.array(path)

    def _step(self, x: Array, u: tuple[Array, Array], cross: Mapping[str, tuple[Array, Array]]) -> Array:
        """One step of the third-order Bogacki-Shampine formula; u and cross are linear over it."""
        h = self.step / self.substeps

        def slope(state: Array, at: float) -> Array:
            return self.rates(state, u[0] + at * u[1], {k: p + at * d for k, (p, d) in cross.items()})

        k1 = slope(x, 0.0)
        k2 = slope(x + 0.5 * h * k1, 0.5)
        k3 = slope(x + 0.75 * h * k2, 0.75)
        new = x + h * (2 * k1 + 3 * k2 + 4 * k3) / 9
        if self.limited:
            new[1] = np.clip(new[1], -self.limit, self.limit)
        return new


def _line(a: Array, b: Array, low: float, high: float) -> tuple[Array, Array]:
    return a + low * (b - a), (high - low) * (b - a)


class Block:
    """x' = A x + B u + forces, y = C x + D u."""

    def __init__(
        self, A: Array, B: Array, step: float, ports: Mapping[str, ForcePort], acts: Sequence
    ) -> None:
        self.exact = Exact(A, B, step)
        self.groups: list[tuple[Array, ForcedLanes]] = []
        for rubs in (False, True):
            lanes = np.array([i for i, act in enumerate(acts) if act.any and act.rubs == rubs], dtype=int)
            if len(lanes):
                used = {p: ports[p] for p in ports if any(acts[i].uses(p) for i in lanes)}
                self.groups.append(
                    (lanes, ForcedLanes(A[lanes], B[lanes], step, used, [acts[i] for i in lanes]))
                )

    def run(self, u: Wave, cross: Mapping[str, Wave]) -> Array:
        """States at the start, and after every step: (steps + 1) x states x lanes."""
        path = self.exact.run(u.a, u.b)
        for lanes, inner in self.groups:
            pushes = {
                port: (w.a[:, lanes], w.b[:, lanes]) for port, w in cross.items() if port in inner.forces
            }
            path[:, :, lanes] = inner.run(u.a[:, lanes], u.b[:, lanes], pushes)
        return path


def output(path: Array, C: Array, D: Array, u: Wave, clock: Clock) -> Wave:
    """y = C x + D u as a wave; C is lanes x states, D one per lane."""
    y = np.einsum("tsl,ls->tl", path, C)
    at = y if clock.count == 0 else y[1:]
    if not D.any():
        return Wave(at, y[:-1], y[1:])
    return Wave(at + D * u.at, y[:-1] + D * u.a, y[1:] + D * u.b)
