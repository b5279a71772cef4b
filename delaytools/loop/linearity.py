"""Whether formulas are linear: by their derivatives, and by their values, since steps have no derivative."""

import casadi as ca
import numpy as np

__all__ = ["is_linear"]

SIZES = (1e-3, 1.0, 1e3)


def is_linear(formulas: ca.SX, variables: ca.SX) -> bool:
    """Whether the formulas are linear (or affine) in the variables; other symbols may stand in them.

    CasADi judges by second derivatives, for which floor and sign are flat: what it calls linear is checked against
    its own tangent at points of three sizes.
    """
    if not ca.is_linear(formulas, variables):
        return False
    others = [symbol for symbol in ca.symvar(formulas) if not ca.depends_on(variables, symbol)]
    origin = ca.substitute(formulas, variables, ca.SX.zeros(*variables.shape))
    off = formulas - origin - ca.mtimes(ca.jacobian(formulas, variables), variables)
    check = ca.Function("off", [variables, ca.vertcat(*others)], [off, formulas - origin])
    generator = np.random.default_rng(1)
    rest = generator.uniform(0.5, 1.5, len(others))
    for size in SIZES:
        point = size * generator.standard_normal(variables.shape[0])
        missed, whole = (np.asarray(part) for part in check(point, rest))
        if np.any(np.abs(missed) > 1e-9 * (1e-300 + np.abs(whole) + size)):
            return False
    return True
