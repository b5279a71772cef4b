"""Noisy columns as sources of effects elsewhere, without the noise of their pick-off."""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from delaytools.diagnosis.noise import Whitening, incoherent_spectrum, whitening
from delaytools.diagnosis.noise_of import column_noise, without_noise
from delaytools.loop.segments import Segment
from delaytools.measurement.segment_runs import run_segment
from delaytools.signals.record import Record

__all__ = ["quiet_sources"]

Array = NDArray[np.float64]


def quiet_sources(
    parts: Sequence[Segment], records: Sequence[Record], sampled: Collection[str]
) -> tuple[tuple[dict[str, Array], ...], dict[str, Whitening]]:
    """Per log, noisy columns as a source would be without its pick-off's noise, and that noise.

    A mode that a noisy column seems to shake would ring with its noise, which shakes nothing. A column is the model of
    its segment as designed, and what of the rest stands clear of the noise: whatever is missing there stays in it.
    """
    columns: tuple[dict[str, Array], ...] = tuple({} for _ in records)
    noise: dict[str, Whitening] = {}
    for part in parts:
        noisy = [exit for exit in part.exits if column_noise(records[0][exit], exit in records[0].held) > 0]
        run = run_segment(part, records, sampled) if noisy else None
        if run is None or run.why:
            continue
        for exit in noisy:
            models = [model for _, _, model in run.traces[exit]]
            if not all(np.isfinite(model).all() for model in models):
                continue
            for own, record, model in zip(columns, records, models, strict=True):
                own[exit] = without_noise(record[exit], model, exit in record.held)
            taken = records[0][exit] - columns[0][exit]
            noise[exit] = whitening(*incoherent_spectrum(taken, np.zeros((len(taken), 0))))
    return columns, noise
