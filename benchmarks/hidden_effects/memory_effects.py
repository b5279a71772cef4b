"""Effects with memory: play, slew limit, hold, lag, mode, and hystereses that no catalogue holds."""

from collections.abc import Mapping

import numpy as np

from benchmarks.hidden_effects.linear import Exact
from benchmarks.hidden_effects.wave import Clock, Wave

Array = np.ndarray
Values = Mapping[str, Array]


class Follower:
    """y follows x point by point: y = follow(y before, x, elapsed). It starts where x starts."""

    def __init__(self, name: str, values: Values) -> None:
        self.follow, self.values = _FOLLOW[name], values
        self.memory: dict[str, Array] = {}

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect, in the order of time."""
        out = Wave(np.empty_like(x.at), np.empty_like(x.a), np.empty_like(x.b))
        if clock.count == 0:
            out.at[0] = self._next(x.at[0], 0.0)
        for j in range(clock.count):
            if leading:
                out.at[j] = self._next(x.at[j], 0.0)
            out.a[j] = self._next(x.a[j], 0.0)
            mean = self._mean((x.a[j], x.b[j]), clock.step)
            out.b[j] = self._next(x.b[j], clock.step)
            if mean is not None:
                out.a[j] = 2 * mean - out.b[j]
            if not leading:
                out.at[j] = self._next(x.at[j], 0.0)
        return out

    def _mean(self, ends: tuple[Array, Array], elapsed: float) -> Array | None:
        """The mean over a step where a line between its ends would not have it: a slew may end far within the step."""
        return _slewed(self.memory["y"], ends, elapsed, self.values["limit"]) if self.follow is _slew else None

    def _next(self, x: Array, elapsed: float) -> Array:
        if not self.memory:
            self.memory = {"y": x, "x": x, "z": np.zeros_like(x)}
        self.memory = self.follow(self.memory, x, elapsed, self.values)
        return self.memory["y"]


def _play(m: dict, x: Array, elapsed: float, p: Values) -> dict:
    y = np.minimum(np.maximum(m["y"], x - p["half_width"]), x + p["half_width"])
    return {**m, "y": y}


def _slew(m: dict, x: Array, elapsed: float, p: Values) -> dict:
    reach = p["limit"] * elapsed
    return {**m, "y": np.minimum(np.maximum(x, m["y"] - reach), m["y"] + reach)}


def _slewed(y: Array, ends: tuple[Array, Array], elapsed: float, limit: Array) -> Array:
    """The mean over a step of what chases a line at most so fast, from y on, and keeps to it once it has met it."""
    first, last = ends
    slope, side = (last - first) / elapsed, np.sign(first - y)
    closing = side * limit - slope
    with np.errstate(divide="ignore", invalid="ignore"):
        met = np.where((first - y) * closing > 0, (first - y) / closing, np.where(first == y, 0.0, elapsed))
    met = np.minimum(met, elapsed)
    rest = elapsed - met
    then = np.clip(slope, -limit, limit)
    return (y * met + side * limit * met**2 / 2 + (first + slope * met) * rest + then * rest**2 / 2) / elapsed


def _bouc_wen(m: dict, x: Array, elapsed: float, p: Values) -> dict:
    """z' = x'/width (1 - |z| (1 + sign(x' z))/2), solved exactly for monotone x; y = x - share width z."""
    move = (x - m["x"]) / p["width"]
    towards = np.sign(move)
    away = m["z"] * towards < 0
    back = np.where(away, np.minimum(np.abs(move), np.abs(m["z"])), 0.0)
    z = m["z"] + towards * back
    rest = np.abs(move) - back
    z = np.where(rest > 0, towards - (towards - z) * np.exp(-rest), z)
    return {"x": x, "z": z, "y": x - p["share"] * p["width"] * z}


def _bent_lag(m: dict, x: Array, elapsed: float, p: Values) -> dict:
    """A lag whose time constant grows with the size of its input."""
    time = p["time_constant"] * (np.abs(x) / p["scale"]) + 1e-5
    return {**m, "y": x + (m["y"] - x) * np.exp(-elapsed / time)}


_FOLLOW = {"backlash": _play, "rate_limit": _slew, "bouc_wen": _bouc_wen, "bent_lag": _bent_lag}


class Hold:
    """A sampler with a period of its own, ticking at t = 0, period, ..."""

    def __init__(self, name: str, values: Values) -> None:
        self.period = values["period"]
        self.value: Array | None = None

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect."""
        if self.value is None:
            self.value = np.array(x.at[0])
        if clock.count == 0:
            return x
        steps = np.rint(self.period / clock.step).astype(int)
        out = Wave(np.empty_like(x.at), np.empty_like(x.a), np.empty_like(x.b))
        for j in range(clock.count):
            self.value = np.where((clock.first + j) % steps == 0, x.a[j], self.value)
            out.a[j] = out.b[j] = self.value
            ticks_after = (clock.first + j + 1) % steps == 0
            out.at[j] = self.value if leading else np.where(ticks_after, x.at[j], self.value)
        return out


class Lag:
    """y = x / (time_constant s + 1), y(0) = 0."""

    def __init__(self, name: str, values: Values) -> None:
        self.time, self.exact = values["time_constant"], None

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect."""
        if self.exact is None:
            pole = 1 / self.time
            self.exact = Exact(-pole[:, None, None], pole[:, None], clock.step)
        return _points(self.exact.run(x.a, x.b)[:, 0], clock, leading)


class Mode:
    """y = x + gain w s / (s^2 + 2 damping w s + w^2) source, w = 2 pi frequency."""

    def __init__(self, name: str, values: Values) -> None:
        self.values, self.exact = values, None

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect; states are deflection z and its speed, z'' + 2 d w z' + w^2 z = w source."""
        assert source is not None
        if self.exact is None:
            w, d = 2 * np.pi * self.values["frequency"], self.values["damping"]
            A = np.zeros((len(w), 2, 2))
            A[:, 0, 1], A[:, 1, 0], A[:, 1, 1] = 1.0, -(w**2), -2 * d * w
            self.exact = Exact(A, np.stack([np.zeros_like(w), w], axis=1), clock.step)
        speed = self.exact.run(source.a, source.b)[:, 1]
        return x.plus(_points(speed, clock, leading), self.values["gain"])


def _points(path: Array, clock: Clock, leading: bool) -> Wave:
    """A continuous signal, given at the grid, as a wave."""
    at = path if clock.count == 0 else path[:-1] if leading else path[1:]
    return Wave(at, path[:-1], path[1:])
