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
    """States (element, state) that are set at a frame to these values (states,); all others go on.

    NaN: the value that the run has there, from which a free beginning starts nonetheless.
    """

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
    at 0, and for each tangent by the start of a `wanted` state, which starts at 1 in its own place. Where the value
    goes on, so do the tangents by free values.
    """
    found = []
    for one, call in zip(anew, calls, strict=True):
        known = {layout.index(k): v for k, v in zip(one.states, one.values, strict=True) if k in layout}
        fixed = {place: v for place, v in known.items() if not np.isnan(v)}
        places, numbers = list(fixed), list(fixed.values())
        for k in range(values + len(wanted)):
            mine = layout.index(wanted[k - values]) if k >= values else -1
            own = known if k >= values else fixed
            places += [size * (1 + k) + place for place in own]
            numbers += [float(place == mine) for place in own]
        found.append(Reset(call, np.array(places, dtype=np.int64), np.array(numbers, dtype=float)))
    return tuple(found)
