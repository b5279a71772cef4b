"""Whether formulas are linear, and in what: by derivatives, and by values, since steps have no derivative."""

import casadi as ca
import numpy as np

__all__ = ["is_linear", "nonlinear_in"]

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


def nonlinear_in(formula: ca.SX, variables: ca.SX) -> list[int]:
    """Indices of the variables on which the formula depends other than by a constant slope of each alone.

    By second derivatives, and by values at points of three sizes: a variable is linear where moving it changes the
    formula by the same, forwards and back, wherever the others are.
    """
    count = variables.shape[0]
    if count == 0:
        return []
    structural = ca.which_depends(formula, variables, 2, False)
    depends = ca.which_depends(formula, variables, 1, False)
    evaluate = ca.Function("formula", [variables], [formula])
    found = [bool(flag) for flag in structural]
    for index in (k for k in range(count) if depends[k] and not found[k]):
        found[index] = any(_bends(evaluate, index, count, size=size) for size in SIZES)
    return [k for k in range(count) if found[k]]


def _bends(evaluate: ca.Function, index: int, count: int, *, size: float) -> bool:
    generator = np.random.default_rng(2)
    at = size * generator.standard_normal((count, 12))
    moved = np.zeros((count, 1))
    moved[index] = size
    change = [np.asarray(evaluate(at + sign * moved) - evaluate(at)).ravel() for sign in (1.0, -1.0)]
    scale = np.abs(np.asarray(evaluate(at))).max() + np.abs(change).max() + 1e-300
    whole = np.concatenate([change[0], -change[1]])
    return bool(np.ptp(whole) > 1e-9 * scale)
