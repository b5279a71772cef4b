"""Where a run begins anew: continuous states set to given values at given frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.loop.network import Key

__all__ = ["Anew", "Reset", "resets"]

Array = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class Anew:
    """States (element, state) that are set at a frame to these values (states,); all others go on."""

    frame: int
    states: tuple[Key, ...]
    values: Array


@final
@dataclass(frozen=True, eq=False)
class Reset:
    """Entries of a call's state that are set before the call number `call`."""

    call: int
    places: NDArray[np.int64]
    values: Array


def resets(
    anew: Sequence[Anew],
    layout: tuple[Key, ...],
    calls: Sequence[int],
    *,
    size: int,
    values: int = 0,
    wanted: tuple[Key, ...] = (),
) -> tuple[Reset, ...]:
    """What to set before which call; a call's state begins with the continuous states, as `layout` names them.

    size: numbers of one state. After them come as many for each of `values` tangents by free values, which start
    at 0, and for each tangent by the start of a `wanted` state, which starts at 1 in its own place.
    """
    found = []
    for one, call in zip(anew, calls, strict=True):
        known = {layout.index(k): v for k, v in zip(one.states, one.values, strict=True) if k in layout}
        places, numbers = list(known), list(known.values())
        for k in range(values + len(wanted)):
            mine = layout.index(wanted[k - values]) if k >= values else -1
            places += [size * (1 + k) + place for place in known]
            numbers += [float(place == mine) for place in known]
        found.append(Reset(call, np.array(places, dtype=np.int64), np.array(numbers, dtype=float)))
    return tuple(found)
