"""What a compensator does to noise, as a formula that can be differentiated."""

import casadi as ca

from delaytools.blocks.block import Continuous, Sampled
from delaytools.loop.linearise import sampler_formulas

__all__ = ["block_noise_gain"]

_TERMS = 64  # of a pulse response


def block_noise_gain(block: Continuous | Sampled) -> ca.SX:
    """What a block does to noise at its noisiest input, as a formula of its free values, without unit.

    Sampled: the white-noise gain, sqrt(Σ_k c_k²) over the pulse response c (its first 64 terms: exact for FIR, the
    same as the root of the mean of |C(e^{jωT})|² over 0..π/T). Continuous: |C(jω)| for ω → ∞, the direct gain.
    """
    if isinstance(block, Sampled):
        F, G, H, D = sampler_formulas(block)
        squares, state = ca.power(D, 2), G
        for _ in range(_TERMS if F.shape[0] else 0):
            squares, state = squares + ca.power(ca.mtimes(H, state), 2), ca.mtimes(F, state)
        return ca.sqrt(ca.mmax(squares))
    x, u = ca.SX.sym("x", len(block.states)), ca.SX.sym("u", len(block.inputs))
    states = ca.vertsplit(x) if block.states else []
    y = ca.vertcat(*[ca.SX(item) for item in block.output(0.0, states, ca.vertsplit(u))])
    direct = ca.densify(ca.substitute(ca.jacobian(y, u), ca.vertcat(x, u), ca.SX.zeros(x.shape[0] + u.shape[0])))
    return ca.mmax(ca.fabs(direct))
