"""What may act on a derivative: x = position, v = rate, load = the other terms that are no friction."""

from collections.abc import Sequence

import numpy as np

Array = np.ndarray
SMALL_SPEED = 1e-9
TERMS = {
    "constant_disturbance": ("level",),
    "cubic_stiffness": ("coefficient",),
    "cubic_damping": ("coefficient",),
    "quadratic_drag": ("coefficient",),
    "coulomb_friction": ("level",),
    "stribeck_friction": ("level", "stiction", "speed"),
    "load_dependent_friction": ("coefficient",),
    "hinge_sine": ("level", "per_unit"),
    "cogging_friction": ("level", "per_unit"),
    "speed_step": ("level", "speed"),
}


class Forces:
    """The forces on one derivative, lane by lane; a lane that lacks a force has it at zero."""

    def __init__(self, effects: Sequence[Sequence[tuple[str, dict]]], smoothing: Array) -> None:
        self.smoothing = smoothing
        self.values: dict[str, dict[str, Array]] = {}
        for name, keys in TERMS.items():
            if any(kind == name for lane in effects for kind, _ in lane):
                self.values[name] = {key: _column(effects, name, key) for key in keys}

    def total(self, x: Array, v: Array, load: Array) -> Array:
        """load + forces - friction."""
        for name, formula in _PLAIN.items():
            if name in self.values:
                load = load + formula(self.values[name], x, v)
        friction = None
        for name, formula in _FRICTION.items():
            if name in self.values:
                part = formula(self.values[name], x, v, load)
                friction = part if friction is None else friction + part
        return load if friction is None else load - friction * np.tanh(v / self.smoothing)

    def stiffness(self) -> float:
        """Largest slope of a friction over its rate, 1/s."""
        slope = np.zeros_like(self.smoothing)
        for name in ("coulomb_friction", "cogging_friction"):
            if name in self.values:
                factor = 2 if name == "cogging_friction" else 1
                slope = slope + factor * self.values[name]["level"] / self.smoothing
        if "stribeck_friction" in self.values:
            slope = slope + self.values["stribeck_friction"]["stiction"] / self.smoothing
        return float(slope.max(initial=0.0))


def _column(effects: Sequence[Sequence[tuple[str, dict]]], name: str, key: str) -> Array:
    neutral = 1.0 if key in ("speed", "per_unit") else 0.0
    return np.array([sum((p[key] for kind, p in lane if kind == name), 0.0) or neutral for lane in effects])


_PLAIN = {
    "constant_disturbance": lambda p, x, v: p["level"],
    "cubic_stiffness": lambda p, x, v: p["coefficient"] * x**3,
    "cubic_damping": lambda p, x, v: p["coefficient"] * v**3,
    "quadratic_drag": lambda p, x, v: p["coefficient"] * v * np.abs(v),
    "hinge_sine": lambda p, x, v: p["level"] * np.sin(p["per_unit"] * x),
    "speed_step": lambda p, x, v: -p["level"] * np.tanh((np.abs(v) / p["speed"]) ** 4) * np.sign(v),
}
_FRICTION = {
    "coulomb_friction": lambda p, x, v, load: p["level"],
    "stribeck_friction": lambda p, x, v, load: (
        p["level"] + (p["stiction"] - p["level"]) * np.exp(-((v / p["speed"]) ** 2))
    ),
    "load_dependent_friction": lambda p, x, v, load: p["coefficient"] * np.abs(load),
    "cogging_friction": lambda p, x, v, load: p["level"] * (1 + np.sin(p["per_unit"] * x)),
}
