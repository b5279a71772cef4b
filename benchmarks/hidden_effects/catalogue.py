"""Every effect with the range of its size at a place, and its other parameters."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
Generator = np.random.Generator


@dataclass(frozen=True)
class Scale:
    """How large things are at a port in the nominal run: signal peak, speed and acceleration peaks, unrelated peak."""

    peak: float
    speed: float
    acceleration: float
    source: float
    busiest: float


@dataclass(frozen=True)
class Size:
    """The parameter that says how much: from `least` to `most` (most may be the smaller number, as for a limit)."""

    parameter: str
    least: Callable[[Scale], float]
    most: Callable[[Scale], float]
    around: float = 0.0
    signed: str = "no"


def _range(parameter: str, least: float, most: float, unit: Callable[[Scale], float], **more) -> Size:
    return Size(parameter, lambda s: least * unit(s), lambda s: most * unit(s), **more)


def _one(scale: Scale) -> float:
    return 1.0


def _peak(scale: Scale) -> float:
    return scale.peak


def _push(scale: Scale) -> float:
    return scale.acceleration


SIZES: dict[str, Size] = {
    "delay": _range("delay", 1e-3, 30e-3, _one),
    "variable_delay": _range("mean", 1.5e-3, 20e-3, _one),
    "lag": _range("time_constant", 1.5e-3, 50e-3, _one),
    "dead_band": _range("half_width", 1e-4, 0.8, _peak),
    "backlash": _range("half_width", 1e-4, 0.8, _peak),
    "saturation": _range("limit", 0.999, 0.1, _peak),
    "rate_limit": _range("limit", 0.99, 0.02, lambda s: s.speed),
    "quantization": _range("step", 1e-4, 0.6, _peak),
    "sample_hold": _range("period", 2e-3, 30e-3, _one),
    "dropped_frames": _range("probability", 0.004, 0.5, _one),
    "scale_factor": _range("factor", 2e-4, 0.6, _one, around=1.0, signed="any"),
    "bias": _range("level", 1e-5, 0.7, _peak, signed="any"),
    "gain_drift": _range("rate", 1e-5, 0.04, _one, signed="any"),
    "transient_gain": _range("factor", 5e-4, 0.95, _one, around=1.0, signed="any"),
    "periodic_interference": _range("amplitude", 1e-5, 1.0, _peak),
    "flexible_mode": _range("gain", 1e-5, 1.0, lambda s: s.peak / s.source, signed="any"),
    "cross_coupling": _range("gain", 1e-5, 1.0, lambda s: s.peak / s.source, signed="any"),
    "constant_disturbance": _range("level", 1e-5, 0.7, _push, signed="any"),
    "coulomb_friction": _range("level", 1e-4, 0.8, _push),
    "stribeck_friction": _range("level", 1e-4, 0.6, _push),
    "load_dependent_friction": _range("coefficient", 1e-3, 0.6, _one),
    "cubic_stiffness": _range("coefficient", 1e-5, 0.8, lambda s: s.acceleration / s.peak**3, signed="any"),
    "cubic_damping": _range(
        "coefficient", 1e-5, 2.0, lambda s: s.acceleration / s.speed**3, signed="mostly negative"
    ),
    "quadratic_drag": _range(
        "coefficient", 1e-5, 2.0, lambda s: s.acceleration / s.speed**2, signed="mostly negative"
    ),
    "parameter_change": _range("change", 2e-3, 0.45, _one, signed="any"),
    "root_characteristic": _range("share", 5e-3, 1.0, _one),
    "asymmetric_gain": _range("share", 2e-3, 0.8, _one, signed="any"),
    "dead_zone_with_jump": _range("half_width", 1e-3, 0.5, _peak),
    "soft_knee": _range("share", 2e-3, 0.7, _one, signed="any"),
    "bouc_wen": _range("share", 5e-3, 0.9, _one),
    "bent_lag": _range("time_constant", 1e-3, 80e-3, _one),
    "hinge_sine": _range("level", 1e-3, 0.8, _push, signed="any"),
    "cogging_friction": _range("level", 1e-3, 0.5, _push),
    "speed_step": _range("level", 1e-3, 20.0, _push),
}
UNKNOWN_WIRE = (
    "root_characteristic",
    "asymmetric_gain",
    "dead_zone_with_jump",
    "soft_knee",
    "bouc_wen",
    "bent_lag",
)
UNKNOWN_FORCE = ("hinge_sine", "cogging_friction", "speed_step")
NAMED = tuple(name for name in SIZES if name not in UNKNOWN_WIRE + UNKNOWN_FORCE)


def amplitude(effect: str, share: float, scale: Scale) -> float:
    """Size between least (share 0) and most (share 1), evenly in its logarithm."""
    size = SIZES[effect]
    least, most = size.least(scale), size.most(scale)
    return float(least * (most / least) ** share)


def shape(effect: str, scale: Scale, rng: Generator, options: Mapping[str, float]) -> dict[str, float]:
    """Everything about an effect that is not its size; `sign` included, ratios to the size as `of_...`."""
    signed = SIZES[effect].signed
    negative = {"no": 0.0, "any": 0.5, "mostly negative": 0.85}[signed]
    drawn: dict[str, float] = {"sign": -1.0 if rng.random() < negative else 1.0}
    drawn.update(_OTHERS[effect](scale, rng) if effect in _OTHERS else {})
    if effect == "transient_gain":
        long = options.get("duration", rng.uniform(1.0, 6.0))
        start = np.clip(scale.busiest - rng.uniform(0.2, 0.8) * long, 0.5, 19.5 - long)
        drawn |= {"start": round(float(start), 3), "end": round(float(start + long), 3)}
    drawn.update({k: v for k, v in options.items() if k in drawn})
    return drawn


def parameters(effect: str, size: float, drawn: Mapping[str, float]) -> dict[str, float]:
    """What the simulator needs, from the size and the rest."""
    plan = SIZES[effect]
    value = plan.around + drawn["sign"] * size
    if effect == "sample_hold":
        value = max(round(value, 3), 2e-3)
    out = {plan.parameter: _digits(value)}
    for name, number in drawn.items():
        if name.startswith("of_"):
            out[name[3:]] = _digits(number * size)
        elif name != "sign":
            out[name] = _digits(number, 6)
    if effect == "variable_delay":
        steepest = 0.3 / (2 * np.pi * out["frequency"])
        out["amplitude"] = _digits(min(out["amplitude"], steepest))
    return out


def _digits(value: float, digits: int = 4) -> float:
    return float(f"{value:.{digits}g}")


def _mode(s: Scale, rng: Generator) -> dict[str, float]:
    return {
        "frequency": rng.uniform(8, 80),
        "damping": float(np.exp(rng.uniform(np.log(0.006), np.log(0.1)))),
    }


_OTHERS: dict[str, Callable[[Scale, Generator], dict[str, float]]] = {
    "variable_delay": lambda s, r: {
        "of_amplitude": r.uniform(0.3, 0.8),
        "frequency": r.uniform(0.2, 3.0),
        "phase": r.uniform(-np.pi, np.pi),
    },
    "periodic_interference": lambda s, r: {"frequency": r.uniform(3, 120), "phase": r.uniform(-np.pi, np.pi)},
    "flexible_mode": _mode,
    "stribeck_friction": lambda s, r: {
        "of_stiction": r.uniform(1.3, 2.2),
        "speed": r.uniform(0.02, 0.12) * s.speed,
    },
    "root_characteristic": lambda s, r: {"scale": s.peak, "power": float(r.choice([1 / 2, 1 / 3]))},
    "soft_knee": lambda s, r: {"scale": s.peak / r.uniform(2, 5)},
    "bouc_wen": lambda s, r: {"width": s.peak * r.uniform(0.05, 0.3)},
    "bent_lag": lambda s, r: {"scale": s.peak},
    "hinge_sine": lambda s, r: {"per_unit": r.uniform(2, 6) / s.peak},
    "cogging_friction": lambda s, r: {"per_unit": r.uniform(3, 9) / s.peak},
    "speed_step": lambda s, r: {"speed": r.uniform(0.2, 0.5) * s.speed},
}
