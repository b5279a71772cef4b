"""Effects without memory: the value now from the value now (and the time)."""

from collections.abc import Callable, Mapping

import numpy as np

from benchmarks.hidden_effects.wave import Clock, Wave

Array = np.ndarray
Values = Mapping[str, Array]


def _dead_band(x: Array, p: Values) -> Array:
    return x - np.clip(x, -p["half_width"], p["half_width"])


def _quantization(x: Array, p: Values) -> Array:
    return p["step"] * np.floor(x / p["step"] + 0.5)


def _root(x: Array, p: Values) -> Array:
    """sign(x) scale (|x|/scale)^power, mixed with the straight line by `share`."""
    bent = np.sign(x) * p["scale"] * (np.abs(x) / p["scale"]) ** p["power"]
    return (1 - p["share"]) * x + p["share"] * bent


def _dead_zone_with_jump(x: Array, p: Values) -> Array:
    return np.where(np.abs(x) < p["half_width"], 0.0, x)


STATIC: dict[str, Callable[[Array, Values], Array]] = {
    "scale_factor": lambda x, p: p["factor"] * x,
    "bias": lambda x, p: x + p["level"],
    "dead_band": _dead_band,
    "saturation": lambda x, p: np.clip(x, -p["limit"], p["limit"]),
    "quantization": _quantization,
    "root_characteristic": _root,
    "asymmetric_gain": lambda x, p: x + p["share"] * np.maximum(x, 0.0),
    "dead_zone_with_jump": _dead_zone_with_jump,
    "soft_knee": lambda x, p: x + p["share"] * np.abs(x) * np.sin(x / p["scale"]),
}
TIMED: dict[str, Callable[[Array, Array, Values], Array]] = {
    "gain_drift": lambda x, t, p: (1 + p["rate"] * t) * x,
    "periodic_interference": lambda x, t, p: (
        x + p["amplitude"] * np.sin(2 * np.pi * p["frequency"] * t + p["phase"])
    ),
}


class Static:
    """y = f(x)."""

    def __init__(self, name: str, values: Values) -> None:
        self.formula, self.values = STATIC[name], values

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect."""
        return x.map(lambda points: self.formula(points, self.values))


class Timed:
    """y = f(x, t)."""

    def __init__(self, name: str, values: Values) -> None:
        self.formula, self.values = TIMED[name], values

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect."""
        return Wave(
            self.formula(x.at, clock.instants(leading), self.values),
            self.formula(x.a, clock.starts, self.values),
            self.formula(x.b, clock.ends, self.values),
        )


class Transient:
    """y = factor x for start <= t < end."""

    def __init__(self, name: str, values: Values) -> None:
        self.values = values

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect; `b` is the value just before the end of a step."""
        nearly = 0.25 * clock.step
        return Wave(
            self._gain(clock.instants(leading) + nearly) * x.at,
            self._gain(clock.starts + nearly) * x.a,
            self._gain(clock.ends - nearly) * x.b,
        )

    def _gain(self, t: Array) -> Array:
        inside = (t >= self.values["start"]) & (t < self.values["end"])
        return np.where(inside, self.values["factor"], 1.0)


class Coupling:
    """y = x + gain source."""

    def __init__(self, name: str, values: Values) -> None:
        self.gain = values["gain"]

    def apply(self, x: Wave, clock: Clock, leading: bool, source: Wave | None) -> Wave:
        """The wave behind the effect."""
        assert source is not None
        return x.plus(source, self.gain)
