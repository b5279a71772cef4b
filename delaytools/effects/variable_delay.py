"""A delay that varies with time."""

from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Scalar, value
from delaytools.blocks.delay import SignalDelay, VariableDelay
from delaytools.effects.effect import Effect, Knowledge, Place, insert_at
from delaytools.loop.loop import Loop
from delaytools.signals.expression import signal_expression
from delaytools.signals.trouble import DesignError

__all__ = ["VariableDelayEffect"]


@final
@dataclass(frozen=True, kw_only=True)
class VariableDelayEffect(Effect):
    """y(t) = u(t - τ(t)), τ = mean + amplitude sin(2π frequency t + phase), or the signal named, in s.

    Raises DesignError where neither `mean` nor `signal` is given, or both, or an amplitude without a frequency.
    """

    mean: Scalar | None = value("s", low=0.0, default=None, neutral=0.0)
    amplitude: Scalar = value("s", low=0.0, default=0.0, neutral=0.0)
    frequency: Scalar | None = value("Hz", low=0.0, default=None)
    phase: Scalar = value("rad", default=0.0)
    signal: str | None = value("name", default=None)

    kind = "variable_delay"
    acts_on = ("input", "output")
    amplitude_dependent = False
    knowledge = Knowledge(
        what="The signal arrives late by a time that itself changes: slowly swinging, or as a recorded column says.",
        cause="Two clocks that drift against each other so that the frame boundaries slide, a shared network or bus "
        "with changing load, a simulation PC whose computing time depends on the flight phase.",
        margins="The phase lost at crossover swings with the delay, so the margin that counts is the one at the "
        "largest delay; a swing near the loop's own frequency also modulates the signal and makes side lines.",
        check="Stamp the packets or send pulses through for many seconds and plot arrival minus sending over time; "
        "a constant delay gives a flat line, two clocks a saw-tooth.",
    )

    def __post_init__(self) -> None:
        advice = "give mean, amplitude and frequency, or the signal that holds the delay in s"
        if (self.mean is None) == (self.signal is None):
            found = "neither mean nor signal" if self.mean is None else "both mean and signal"
            raise DesignError("variable_delay takes its delay from one place", found=found, advice=advice)
        if self.signal is None and self.frequency is None and self.amplitude != 0:
            raise DesignError("missing required value", where="frequency", advice="give frequency (in Hz)")

    def apply(self, loop: Loop, place: Place) -> Loop:
        if self.signal is not None:
            sources = {"delay": signal_expression(self.signal)}
            return insert_at(loop, place, self, SignalDelay(), sources=sources)
        wave = VariableDelay(
            mean=self.mean,
            amplitude=self.amplitude,
            frequency=0.0 if self.frequency is None else self.frequency,
            phase=self.phase,
        )
        return insert_at(loop, place, self, wave)
