"""Linear time responses with exact delays, to rounding: the method of steps on polynomials of high degree."""

from collections.abc import Callable, Sequence
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from delaytools.analysis.break_times import break_times
from delaytools.analysis.step_elements import elements, march
from delaytools.linear.channel import Delay, Hold
from delaytools.linear.delay_system import DelaySystem, as_delay_system
from delaytools.signals.trouble import AnalysisError

__all__ = ["forced_response", "impulse_response", "initial_response", "step_response"]

RealArray = NDArray[np.float64]
Waves = Callable[[RealArray], RealArray]  # times (k,) -> inputs (nu, k)


def step_response(system: Any, T: ArrayLike, *, input: int | str | None = None) -> control.TimeResponseData:
    """The response at the times T (s, rising, from 0) to a unit step at t = 0, everything at rest before.

    system: a DelaySystem or what becomes one. input: one of its inputs; None: each in turn. Gives python-control's
    TimeResponseData, y (ny, inputs, len(T)), so that its plots and `control.step_info` take it. Raises AnalysisError
    for times that do not rise from 0 and for an input that is not there.
    """
    whole, times = as_delay_system(system), _times(T)
    chosen = _chosen(whole, input)
    rows = [_run(whole[slice(None), [k]], times, lambda t: np.ones((1, len(t)))) for k in chosen]
    return _traces(whole, times, (rows, chosen), 1.0)


def impulse_response(system: Any, T: ArrayLike, *, input: int | str | None = None) -> control.TimeResponseData:
    """The response to a unit impulse at t = 0: that of the states x(0) = B1. Shapes as of `step_response`.

    Raises AnalysisError where an input passes on directly, at once or into a delay: that answer is no function.
    """
    whole, times = as_delay_system(system), _times(T)
    chosen = _chosen(whole, input)
    return _traces(whole, times, ([_after_impulse(whole[slice(None), [k]], times) for k in chosen], chosen), 0.0)


def _after_impulse(one: DelaySystem, times: RealArray) -> RealArray:
    simple = _with_delays_alone(one.without_zero_delays())
    if simple.D11.any() or simple.D21.any():
        raise AnalysisError(
            "an impulse passes straight through: its response is not a function",
            found="a direct gain from the input",
            advice="put a lag in the way, or ask for the step response",
        )
    return _marched(simple, times, lambda t: np.zeros((1, len(t))), simple.B1[:, 0], starts=True)


def initial_response(system: Any, T: ArrayLike, X0: ArrayLike) -> control.TimeResponseData:
    """The response from the states X0 (n,) of the rational part, with empty delays and no input."""
    whole = _with_delays_alone(as_delay_system(system).without_zero_delays())
    times, begin = _times(T), np.asarray(X0, dtype=float)
    given = as_delay_system(system).n_states
    if begin.shape != (given,):
        raise AnalysisError("a state for each rational state", found=f"shape {begin.shape}", advice=f"give {given}")
    begin = np.concatenate([begin, np.zeros(whole.n_states - given)])
    nothing = np.zeros((whole.shape[1], len(times)))
    rows = _marched(whole, times, lambda t: np.zeros((whole.shape[1], len(t))), begin, starts=True)
    return _data(as_delay_system(system), times, rows, nothing)


def forced_response(system: Any, T: ArrayLike, U: ArrayLike) -> control.TimeResponseData:
    """The response to inputs U (nu, len(T)) or (len(T),) at the times T, joined by straight lines; at rest before."""
    whole = as_delay_system(system)
    times, rows = _times(T), np.atleast_2d(np.asarray(U, dtype=float))
    if rows.shape != (whole.shape[1], len(times)):
        raise AnalysisError(
            "an input value for each input and time", found=f"shape {rows.shape}",
            advice=f"give U of shape ({whole.shape[1]}, {len(times)})",
        )  # fmt: skip

    def waves(t: RealArray) -> RealArray:
        return np.stack([np.interp(t, times, row) for row in rows])

    kinks = times[1:-1][np.any(np.diff(np.diff(rows) / np.diff(times)) != 0, axis=0)] if len(times) > 2 else times[:0]
    return _data(whole, times, _run(whole, times, waves, kinks), rows)


def _chosen(system: DelaySystem, input: int | str | None) -> list[int]:
    return list(range(system.shape[1])) if input is None else [_index(system, input)]


def _index(system: DelaySystem, input: int | str) -> int:
    known = list(system.inputs)
    if isinstance(input, str):
        if input not in known:
            raise AnalysisError("no such input", found=repr(input), known=known)
        return known.index(input)
    if not 0 <= input < len(known):
        raise AnalysisError("no such input", found=str(input), known=[str(k) for k in range(len(known))])
    return input


def _times(T: ArrayLike) -> RealArray:
    times = np.asarray(T, dtype=float)
    good = times.ndim == 1 and len(times) > 1 and np.all(np.isfinite(times))
    if not good or times[0] != 0 or np.any(np.diff(times) <= 0):
        raise AnalysisError(
            "times rise from 0", found=f"{np.array2string(times, threshold=4)}",
            advice="give np.linspace(0, 10, 1001)",
        )  # fmt: skip
    return times


def _run(system: DelaySystem, times: RealArray, waves: Waves, kinks: Sequence[float] | RealArray = ()) -> RealArray:
    simple = _with_delays_alone(system.without_zero_delays())
    return _marched(simple, times, waves, np.zeros(simple.n_states), kinks=kinks)


def _marched(
    system: DelaySystem,
    times: RealArray,
    waves: Waves,
    begin: RealArray,
    *,
    kinks: Sequence[float] | RealArray = (),
    starts: bool = False,
) -> RealArray:
    """Outputs (ny, len(times)); starts: the states jump at t = 0, as behind an impulse, not the inputs."""
    breaks = break_times(system, float(times[-1]), [(0.0, -1 if starts else 0), *((float(t), 1) for t in kinks)])
    return march(system, elements(system, breaks, float(times[-1])), waves, begin).outputs(times)


def _with_delays_alone(system: DelaySystem) -> DelaySystem:
    """Each hold as a state: w' = (z(t) - z(t - T))/T."""
    held = [i for i, channel in enumerate(system.channels) if isinstance(channel, Hold)]
    if not held:
        return system
    h = len(held)
    periods = np.array([system.channels[i].span for i in held])
    swap = np.zeros((system.n_channels, system.n_channels))  # w = W_x v + W_w z_late with v the holds' states
    late = [i for i in range(system.n_channels) if i not in held]
    swap[late, late] = 1.0
    states = np.zeros((system.n_channels, h))
    states[held, range(h)] = 1.0
    B2, D12, D22 = system.B2, system.D12, system.D22
    rows_x = system.C2[held], system.D21[held], D22[held]
    A = np.block([
        [system.A, B2 @ states],
        [rows_x[0] / periods[:, None], rows_x[2] @ states / periods[:, None]],
    ])  # fmt: skip
    into = np.zeros((h, system.n_channels))
    into[range(h), held] = -1.0 / periods
    return DelaySystem(
        A=A, B1=np.vstack([system.B1, rows_x[1] / periods[:, None]]),
        B2=np.vstack([B2 @ swap, rows_x[2] @ swap / periods[:, None] + into]),
        C1=np.hstack([system.C1, D12 @ states]), C2=np.hstack([system.C2, D22 @ states]),
        D11=system.D11, D12=D12 @ swap, D21=system.D21, D22=D22 @ swap,
        channels=tuple(Delay(channel.span) for channel in system.channels),
        inputs=system.inputs, outputs=system.outputs,
    )  # fmt: skip


def _traces(
    system: DelaySystem, times: RealArray, found: tuple[list[RealArray], list[int]], level: float
) -> control.TimeResponseData:
    rows, chosen = found
    given = np.zeros((system.shape[1], len(chosen), len(times)))
    for trace, k in enumerate(chosen):
        given[k, trace] = level
    names = [system.inputs[k] for k in chosen]
    return control.TimeResponseData(
        times, np.stack(rows, axis=1), None, given, issiso=system.shape == (1, 1),
        output_labels=list(system.outputs), input_labels=list(system.inputs), trace_labels=names,
    )  # fmt: skip


def _data(system: DelaySystem, times: RealArray, rows: RealArray, given: RealArray) -> control.TimeResponseData:
    return control.TimeResponseData(
        times, rows, None, given, issiso=system.shape == (1, 1), output_labels=list(system.outputs),
        input_labels=list(system.inputs),
    )  # fmt: skip
