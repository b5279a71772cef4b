"""Inputs that a bench may be given to tell rivals apart, in the words of a design file's [inputs]."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

__all__ = ["BIAS", "DOUBLE", "LOOP_BACK", "SINE", "TRIANGLE", "Trial", "trials"]

SINE, DOUBLE, TRIANGLE = "sine", "double amplitude", "slow triangle"
BIAS, LOOP_BACK = "small oscillation about a bias", "pulse"
TONES = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # Hz
FASTEST = 0.05  # cycles per row
SMALL = 0.1  # of the peak: least size of an oscillation about a bias


@final
@dataclass(frozen=True, eq=False)
class Trial:
    """One input: `signal` driven by what `table` says, as a design file would; manner: what kind of test it is."""

    manner: str
    signal: str
    table: Mapping[str, Any]


def trials(
    signal: str, peak: float, *, step: float, width: float = 0.0, seconds: float = 20.0, doubled: bool = False
) -> tuple[Trial, ...]:
    """Every admissible input at a signal, of amplitude `peak` at most; with sines of twice that where `doubled`.

    width: the largest half width that a rival states, in the signal's unit. step: between rows, s.
    """
    tones = [f for f in TONES if f * step <= FASTEST] or [FASTEST / step]
    tables: list[tuple[str, dict[str, Any]]] = [
        ("step", {"type": "step", "amplitude": peak, "start": 0.5}),
        ("doublet", {"type": "doublet", "amplitude": peak, "start": 0.5, "width": 0.5}),
        (LOOP_BACK, {"type": "pulse", "amplitude": peak, "start": 0.5, "width": 0.1}),
        ("multisine", {"type": "multisine", "amplitude": peak / 2, "band": [0.2, tones[-1]], "lines": 32}),
        ("chirp", {"type": "chirp", "amplitude": peak, "band": [0.2, tones[-1]], "duration": seconds}),
        (TRIANGLE, {"type": "formula", "formula": _triangle(peak, 0.2)}),
    ]
    tables += [(SINE, {"type": "sine", "amplitude": peak, "frequency": f}) for f in tones]
    tables += [(DOUBLE, {"type": "sine", "amplitude": 2 * peak, "frequency": f}) for f in tones if doubled]
    small = min(max(2 * width, SMALL * peak), 0.5 * peak)
    tables += [(BIAS, {"type": "formula", "formula": _about(peak - small, small, f)}) for f in (1.0, 4.0)]
    return tuple(Trial(manner, signal, table) for manner, table in tables)


def _triangle(peak: float, frequency: float) -> str:
    """The first four harmonics of a triangle: 8/π² Σ ± sin((2k+1) ωt)/(2k+1)²."""
    turn = f"2*pi*{frequency:g}*t"
    parts = f"sin({turn}) - sin(3*{turn})/9 + sin(5*{turn})/25 - sin(7*{turn})/49"
    return f"{peak:.6g}*8/pi**2*({parts})"


def _about(bias: float, amplitude: float, frequency: float) -> str:
    """A sine about a bias that is reached in the first second."""
    return f"{bias:.6g}*min(t, 1) + {amplitude:.6g}*sin(2*pi*{frequency:g}*t)"
