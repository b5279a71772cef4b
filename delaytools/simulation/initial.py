"""The state before a run begins, as a formula of the free values: signals at their initial values."""

import casadi as ca

from delaytools.simulation.physics import Physics

__all__ = ["initial_formula", "initial_slopes"]


def initial_formula(model: Physics, depth: int) -> ca.Function:
    """(external inputs before t = 0, p) -> state of a call whose delays hold `depth` spans of history."""
    layout, p, external = model.layout, ca.SX.sym("p", len(model.free)), ca.SX.sym("e", len(model.layout.externals))
    states = ca.vertcat(ca.SX(0, 1), *(s for e in model.net.loop.continuous for s in e.block.initial_state))
    kept = [s for e in model.net.loop.sampled for s in e.block.initial_state]
    held = ca.SX.zeros(len(layout.held), 1)
    delayed, memory = ca.SX.zeros(len(layout.transports), 1), ca.SX.zeros(len(layout.followers), 1)
    count = delayed.numel() + memory.numel()
    for _ in range(1 + count if count else 0):
        point = [states, held, delayed, memory, external, 0.0, 0.0, model.symbol]
        delayed, _ = model.delayed(*point, ca.SX.zeros(external.shape), ca.SX.zeros(delayed.shape))
        memory = model.settled(*point)
    pieces = [n for k in range(delayed.numel()) for _ in range(depth) for n in (delayed[k], 0.0, delayed[k], 0.0)]
    state = ca.vertcat(ca.SX(0, 1), states, held, *kept, memory, *pieces)
    function = ca.Function("symbols", [external, model.symbol], [ca.densify(state)])
    return ca.Function("initial", [external, p], [function(external, p)])


def initial_slopes(formula: ca.Function) -> ca.Function:
    """(external inputs before t = 0, p) -> (state, free values): the formula's derivatives by p."""
    arguments = formula.sx_in()
    slopes = ca.densify(ca.jacobian(formula(*arguments), arguments[1]))
    return ca.Function("initial_slopes", arguments, [slopes])
