"""What drives a bench: demands of several shapes, one value per row, starting from rest."""

from collections.abc import Callable

import numpy as np

Array = np.ndarray
Generator = np.random.Generator
ROW = 1e-3


def _multisine(t: Array, rng: Generator) -> Array:
    lines = rng.choice(np.arange(4, 160), size=int(rng.integers(8, 20)), replace=False) * 0.05
    return sum(np.sin(2 * np.pi * f * t + rng.uniform(-np.pi, np.pi)) / (1 + f / 1.5) for f in lines)


def _chirp(t: Array, rng: Generator) -> Array:
    low, high = rng.uniform(0.1, 0.3), rng.uniform(4, 9)
    sweep = rng.uniform(8, 20)
    within = np.mod(t, sweep)
    phase = 2 * np.pi * low * sweep / np.log(high / low) * ((high / low) ** (within / sweep) - 1)
    return np.sin(phase)


def _steps(t: Array, rng: Generator) -> Array:
    """Doublets and steps of random size, one after the other."""
    y, now = np.zeros_like(t), rng.uniform(0.2, 0.6)
    while now < t[-1]:
        width, size = rng.uniform(0.2, 0.9), rng.uniform(0.3, 1.0) * rng.choice([-1, 1])
        y += size * ((t >= now) & (t < now + width))
        if rng.random() < 0.7:
            y -= size * ((t >= now + width) & (t < now + 2 * width))
        now += 2 * width + rng.uniform(0.1, 0.8)
    return y


def _noise(t: Array, rng: Generator) -> Array:
    spectrum = np.fft.rfft(rng.standard_normal(len(t)))
    f = np.fft.rfftfreq(len(t), ROW)
    return np.fft.irfft(spectrum / (1 + (f / rng.uniform(1.5, 4)) ** 4), len(t))


def _triangle_steps(t: Array, rng: Generator) -> Array:
    period = rng.uniform(3, 8)
    triangle = 2 / np.pi * np.arcsin(np.sin(2 * np.pi * t / period))
    return triangle + 0.3 * _steps(t, rng)


def _rest_doublet(t: Array, rng: Generator) -> Array:
    start, width = rng.uniform(3, 14), rng.uniform(0.3, 0.8)
    return 1.0 * ((t >= start) & (t < start + width)) - 1.0 * ((t >= start + width) & (t < start + 2 * width))


SHAPES: dict[str, Callable[[Array, Generator], Array]] = {
    "multisine": _multisine,
    "chirp": _chirp,
    "steps": _steps,
    "noise": _noise,
    "triangle_steps": _triangle_steps,
    "rest_doublet": _rest_doublet,
}
WEIGHTS = {"multisine": 3, "chirp": 2, "steps": 3, "noise": 2, "triangle_steps": 2, "rest_doublet": 1}


def demand(shape: str, size: float, rows: int, rng: Generator) -> Array:
    """A demand of this shape; its 99th percentile (or its peak, where mostly at rest) is `size`."""
    t = np.arange(rows) * ROW
    y = SHAPES[shape](t, rng)
    high = np.percentile(np.abs(y), 99)
    y = y / (high if high > 0.1 * np.abs(y).max() else np.abs(y).max())
    return size * y * np.clip(t / 0.1, 0, 1) ** 2


def unrelated(rows: int, rng: Generator) -> Array:
    """A signal of some other channel, deg/s."""
    y = _noise(np.arange(rows) * ROW, rng)
    return y * rng.uniform(15, 30) / np.std(y)


def noise(rms: float, corner: float | None, rows: int, rng: Generator) -> Array:
    """White noise, or noise behind a first-order lag of this corner (Hz), one value per row."""
    white = rng.standard_normal(rows)
    if corner is None:
        return rms * white
    keep = np.exp(-2 * np.pi * corner * ROW)
    y, now = np.empty(rows), white[0]
    for i, w in enumerate(white):
        now = keep * now + np.sqrt(1 - keep**2) * w if i else w
        y[i] = now
    return rms * y
