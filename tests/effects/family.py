"""Every effect of the catalogue with values that show, and the port of the servo where it acts."""

from delaytools.effects.backlash import BacklashEffect
from delaytools.effects.bias import BiasEffect
from delaytools.effects.constant_disturbance import ConstantDisturbanceEffect
from delaytools.effects.coulomb_friction import CoulombFrictionEffect
from delaytools.effects.cross_coupling import CrossCouplingEffect
from delaytools.effects.cubic_damping import CubicDampingEffect
from delaytools.effects.cubic_stiffness import CubicStiffnessEffect
from delaytools.effects.dead_band import DeadBandEffect
from delaytools.effects.delay import DelayEffect
from delaytools.effects.dropped_frames import DroppedFramesEffect
from delaytools.effects.effect import Effect
from delaytools.effects.flexible_mode import FlexibleModeEffect
from delaytools.effects.formula import FormulaEffect
from delaytools.effects.gain_drift import GainDriftEffect
from delaytools.effects.lag import LagEffect
from delaytools.effects.load_dependent_friction import LoadDependentFrictionEffect
from delaytools.effects.parameter_change import ParameterChange
from delaytools.effects.periodic_interference import PeriodicInterferenceEffect
from delaytools.effects.quadratic_drag import QuadraticDragEffect
from delaytools.effects.quantization import QuantizationEffect
from delaytools.effects.rate_limit import RateLimitEffect
from delaytools.effects.sample_hold import SampleHoldEffect
from delaytools.effects.saturation import SaturationEffect
from delaytools.effects.scale_factor import ScaleFactorEffect
from delaytools.effects.stribeck_friction import StribeckFrictionEffect
from delaytools.effects.transient_gain import TransientGainEffect
from delaytools.effects.variable_delay import VariableDelayEffect
from delaytools.signals.expression import Expression

SIGNAL: dict[str, Effect] = {
    "delay": DelayEffect(delay=0.0123),
    "variable delay": VariableDelayEffect(mean=0.02, amplitude=0.006, frequency=1.7, phase=0.3),
    "delay from a column": VariableDelayEffect(signal="late"),
    "lag": LagEffect(time_constant=0.03),
    "dead band": DeadBandEffect(half_width=0.1),
    "backlash": BacklashEffect(half_width=0.1),
    "saturation": SaturationEffect(limit=0.4),
    "rate limit": RateLimitEffect(limit=3.0),
    "quantization": QuantizationEffect(step=0.05),
    "sample hold": SampleHoldEffect(period=0.007),
    "scale factor": ScaleFactorEffect(factor=1.2),
    "bias": BiasEffect(level=-0.1),
    "gain drift": GainDriftEffect(rate=-0.2),
    "transient gain": TransientGainEffect(factor=0.5, start=0.4, end=0.9),
    "transient gain between frames": TransientGainEffect(factor=0.5, start=0.40037, end=0.90051),
    "interference": PeriodicInterferenceEffect(amplitude=0.05, frequency=12.0, phase=-1.0),
    "flexible mode": FlexibleModeEffect(gain=0.3, frequency=9.0, damping=0.05, source="position"),
    "coupling": CrossCouplingEffect(gain=0.2, source="gust"),
    "formula": FormulaEffect(formula=Expression("u + k*u*abs(u)"), parameters={"k": 0.3}, neutral={"k": 0.0}),
    "formula with time and a signal": FormulaEffect(
        formula=Expression("u*(1 + a*t) + b*gust**2"),
        parameters={"a": 0.1, "b": 0.2},
        neutral={"a": 0.0, "b": 0.0},
    ),
}
DERIVATIVE: dict[str, Effect] = {
    "constant disturbance": ConstantDisturbanceEffect(level=150.0),
    "coulomb friction": CoulombFrictionEffect(level=120.0, smoothing=0.5),
    "stribeck friction": StribeckFrictionEffect(level=80.0, stiction=160.0, speed=2.0, smoothing=0.5),
    "load-dependent friction": LoadDependentFrictionEffect(coefficient=0.2, smoothing=0.5),
    "cubic stiffness": CubicStiffnessEffect(coefficient=-300.0),
    "cubic damping": CubicDampingEffect(coefficient=-0.5),
    "quadratic drag": QuadraticDragEffect(coefficient=-3.0),
    "coupling of moments": CrossCouplingEffect(gain=200.0, source="gust"),
    "formula of position and rate": FormulaEffect(
        formula=Expression("c*x*abs(v) + d*gust*cos(t)"),
        parameters={"c": -20.0, "d": 90.0},
        neutral={"c": 0.0, "d": 0.0},
    ),
}
OTHERS: dict[str, tuple[Effect, str]] = {
    "rate limit of the element": (RateLimitEffect(limit=2.0), "actuator.rate"),
    "dropped frames": (DroppedFramesEffect(probability=0.3), "sampler.output"),
    "parameter change": (ParameterChange(name="natural_frequency", new=30.0), "actuator"),
    "parameter change in a list": (ParameterChange(name="denominator[1]", new=3.0), "plant"),
}
FAMILY: dict[str, tuple[Effect, str]] = {
    **{name: (effect, "probe.output") for name, effect in SIGNAL.items()},
    **{f"{name} at an input": (effect, "actuator.input") for name, effect in SIGNAL.items()},
    **{name: (effect, "actuator.rate'") for name, effect in DERIVATIVE.items()},
    **OTHERS,
}
CLASSES = tuple({type(effect): effect for effect, _ in FAMILY.values()}.values())
