"""What a quantiser at an exit makes of noise ahead of it: an error that goes with the signal, and is no structure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from delaytools.blocks.quantizer import Quantizer
from delaytools.diagnosis.added import with_added
from delaytools.diagnosis.case import Case
from delaytools.diagnosis.fitting import Fitted
from delaytools.diagnosis.views import case_view

__all__ = ["Roundings", "roundings"]

Array = NDArray[np.float64]
CELLS = 32  # of a step


@final
@dataclass(frozen=True, eq=False)
class Roundings:
    """cells: exit -> per log (n,), in which part of a step the model's signal is ahead of the quantiser there."""

    cells: Mapping[str, tuple[NDArray[np.int64], ...]]

    def less_mean(self, residual: Array, exit: str, log: int) -> Array:
        """A residual (n,) less its mean in each part of a step.

        Near an edge noise tips the rounding one way more often than back: measured less model is then, in the mean, a
        function of where in a step the signal is, as dither shows (Schuchman 1964).
        """
        if exit not in self.cells:
            return residual
        cell = self.cells[exit][log]
        count = np.maximum(np.bincount(cell, minlength=CELLS), 1)
        return np.asarray(residual - (np.bincount(cell, residual, CELLS) / count)[cell])


def roundings(case: Case, fitted: Fitted) -> Roundings:
    """The quantisers of a hypothesis that write an exit."""
    loop = with_added(case.segment.loop, fitted.added)
    writers = {exit: loop[loop.writers[exit][0]] for exit in case.exits}
    names = {exit: e.name for exit, e in writers.items() if isinstance(e.block, Quantizer)}
    if not names:
        return Roundings({})
    view, cells = case_view(case, fitted), {}
    for exit, name in names.items():
        element = view.loop[name]
        step = float(element.block.step)  # type: ignore[attr-defined]
        signals = (view.evaluated(element.inputs[element.block.inputs[0]], k) for k in range(len(case.records)))
        cells[exit] = tuple((np.mod(u / step, 1.0) * CELLS).astype(np.int64) % CELLS for u in signals)
    return Roundings(cells)
