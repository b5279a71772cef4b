"""Every kind of block and effect by the name that a design file uses."""

from contextlib import AbstractContextManager

from delaytools.blocks.backlash import Backlash
from delaytools.blocks.block import Block
from delaytools.blocks.dead_band import DeadBand
from delaytools.blocks.delay import Delay
from delaytools.blocks.first_order import FirstOrder
from delaytools.blocks.gain import Gain
from delaytools.blocks.integrator import Integrator
from delaytools.blocks.lead_lag import LeadLag
from delaytools.blocks.notch import Notch
from delaytools.blocks.quantizer import Quantizer
from delaytools.blocks.rate_limiter import RateLimiter
from delaytools.blocks.relay import Relay
from delaytools.blocks.sample_hold import SampleHold
from delaytools.blocks.saturation import Saturation
from delaytools.blocks.second_order import SecondOrder
from delaytools.blocks.state_space import StateSpace
from delaytools.blocks.transfer_function import TransferFunction
from delaytools.compensators.dynamic import DynamicCompensator, DynamicCompensatorAlone
from delaytools.compensators.encoder_referenced import EncoderReferencedCompensator
from delaytools.compensators.inverse import InverseCompensator
from delaytools.compensators.lead import LeadCompensator
from delaytools.design.plugged import Kinds
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

__all__ = ["BLOCKS", "EFFECTS", "PARAMETER_CHANGE", "with_effects"]

PARAMETER_CHANGE = "parameter_change"

BLOCKS: dict[str, type[Block]] = {
    "gain": Gain,
    "integrator": Integrator,
    "first_order": FirstOrder,
    "second_order": SecondOrder,
    "transfer_function": TransferFunction,
    "state_space": StateSpace,
    "lead_lag": LeadLag,
    "notch": Notch,
    "delay": Delay,
    "sample_hold": SampleHold,
    "dead_band": DeadBand,
    "saturation": Saturation,
    "quantizer": Quantizer,
    "backlash": Backlash,
    "relay": Relay,
    "rate_limiter": RateLimiter,
    "inverse_compensator": InverseCompensator,
    "lead_compensator": LeadCompensator,
    "dynamic_compensator": DynamicCompensator,
    "dynamic_compensator_alone": DynamicCompensatorAlone,
    "encoder_referenced_compensator": EncoderReferencedCompensator,
}

_OWN: dict[str, type[Effect]] = {
    kind.kind: kind
    for kind in (
        BacklashEffect,
        BiasEffect,
        ConstantDisturbanceEffect,
        CoulombFrictionEffect,
        CrossCouplingEffect,
        CubicDampingEffect,
        CubicStiffnessEffect,
        DeadBandEffect,
        DelayEffect,
        DroppedFramesEffect,
        FlexibleModeEffect,
        FormulaEffect,
        GainDriftEffect,
        LagEffect,
        LoadDependentFrictionEffect,
        PeriodicInterferenceEffect,
        QuadraticDragEffect,
        QuantizationEffect,
        RateLimitEffect,
        SampleHoldEffect,
        SaturationEffect,
        ScaleFactorEffect,
        StribeckFrictionEffect,
        TransientGainEffect,
        VariableDelayEffect,
    )
}

EFFECTS = Kinds(_OWN)


def with_effects(*kinds: type[Effect]) -> AbstractContextManager[None]:
    """`with with_effects(MyEffect): …`: within it a design may name these kinds of effect; elsewhere nothing changes.

    It holds for this thread alone. Other processes do not see it: diagnose with `processes=1`, or install a package
    with an entry point of the group `delaytools.effects`. Raises DesignError for what is no effect, or a name taken.
    """
    return EFFECTS.offered(*kinds)
