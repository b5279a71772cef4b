"""Adequate or not: whether an error is more than the noise explains, and large enough to matter."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from delaytools.measurement.measures import Trace, rms
from delaytools.measurement.residual_spectra import Spectra, bands, holm, spectra
from delaytools.measurement.segment_runs import RESOLVED

__all__ = ["Judged", "judged"]

Array = NDArray[np.float64]
SURE = 1e-4  # chance of a false alarm per signal
PART_OF_NOISE = 0.25  # of the noise's rms that a difference must reach
IN_A_BAND = 1.5  # times the noise there, where a difference is small in all
READ = 0.5  # of the carried noise: an error below it shows that the noise is part of what the segment reads


@final
@dataclass(frozen=True, eq=False)
class Judged:
    """What was found of one signal.

    spectra. noise_rms: of the exit. carried_rms: sent by its inputs. explained_rms: both and rounding.
    difference_rms: beyond that. verdict, and reason in words.
    """

    spectra: Spectra
    noise_rms: float
    carried_rms: float
    explained_rms: float
    difference_rms: float
    verdict: str
    reason: str


def judged(
    traces: Sequence[Trace], noise: float, carried: Sequence[Array], references: Sequence[Sequence[Array]]
) -> Judged:
    """The error of a signal against its own noise (rms) and the noise carried to it; all by logs.

    Tests, together by Holm's correction: its mean; by frequency its power against that of the noise, and its
    coherence with the references (per reference, per log, on the rows of the log), bound 1 - (1 - c)^(1/(L - 1)).
    What is significant counts where it reaches a quarter of the noise, or 1.5 times the noise of some band.
    """
    errors = [y - m for _, y, m in traces]
    whole = np.concatenate(errors)
    size = max(rms(np.concatenate([y for _, y, _ in traces])), rms(np.concatenate([m for _, _, m in traces])))
    sent, said = rms(np.concatenate(list(carried))), ""
    if sent > 0 and rms(whole) < READ * sent:
        carried = [np.zeros_like(rows) for rows in carried]
        said = "the noise of its inputs is part of what it reads and adds nothing; "
        sent = 0.0
    floor = RESOLVED * size
    time = [t for t, _, _ in traces]
    step = float(np.median(np.diff(time[0])))
    around, *columns = (_even(rows, step, time) for rows in (errors, carried, *references))
    white = float(np.hypot(noise, floor))
    seen = spectra(step, around, columns[0], columns[1:], white)
    centred = spectra(step, [rows - whole.mean() for rows in around], columns[0], columns[1:], white)
    difference, peak = _beyond(centred, float(whole.mean()), len(whole))
    difference = min(difference, rms(whole))
    total = float(np.sqrt(noise**2 + floor**2 + sent**2))
    fails = difference > PART_OF_NOISE * total or peak > IN_A_BAND**2
    words = said + _words(difference, total, fails)
    return Judged(seen, noise, sent, total, difference, "fails" if fails else "adequate", words)


def _even(logs: Sequence[Array], step: float, time: Sequence[Array]) -> list[Array]:
    """The rows of each log at even times, `step` s apart."""
    found = []
    for rows, t in zip(logs, time, strict=True):
        grid = t[0] + step * np.arange(int((t[-1] - t[0]) / step + 1e-6) + 1)
        found.append(
            rows if len(grid) == len(t) and np.abs(grid - t).max() < 1e-3 * step else np.interp(grid, t, rows)
        )
    return found


def _beyond(seen: Spectra, offset: float, count: int) -> tuple[float, float]:
    """rms that is significantly more than noise, and the largest ratio to the noise of its band.

    seen: of the error without its mean, which is `offset` over `count` rows.
    """
    groups = bands(seen.frequency)
    level = np.array([seen.level_chance(g) for g in groups])
    window = 2 * (len(seen.frequency) - 1)
    steady = float(np.sqrt(max(seen.noise[0], 1e-300) * window / count))
    chances = np.r_[level, 2 * norm.sf(abs(offset) / steady), seen.p_coherence]
    sure = holm(chances, SURE)
    excess, peak = 0.0, 0.0
    for group in (g for g, s in zip(groups, sure[: len(groups)], strict=True) if s):
        more = float(seen.error[group].sum() - seen.noise[group].sum())
        excess += max(more, 0.0)
        peak = max(peak, more / max(float(seen.noise[group].sum()), 1e-300))
    lines = sure[len(groups) + 1 :]
    coherent = float((seen.coherence * seen.error)[lines].sum())
    steady_part = offset**2 if sure[len(groups)] else 0.0
    return float(np.sqrt(max(excess, coherent) + steady_part)), peak


def _words(difference: float, total: float, fails: bool) -> str:
    if fails:
        return f"an error of {difference:.3g} rms is more than its noise of {total:.3g} explains"
    if difference > 0:
        return (
            f"a difference of {difference:.2g} rms is significant, but small beside the noise of {total:.3g}"
        )
    return "the error is what its noise explains"
