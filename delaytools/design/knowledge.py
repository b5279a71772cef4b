"""What an engineer should know of an effect, by the name that a design file gives it."""

from delaytools.design.catalogue import EFFECTS, PARAMETER_CHANGE
from delaytools.effects.effect import Knowledge
from delaytools.effects.parameter_change import ParameterChange

__all__ = ["knowledge_of"]


def knowledge_of(kind: str) -> Knowledge:
    """What it is, what causes it on a bench, what it does to the margins, how to check it."""
    return ParameterChange.knowledge if kind.startswith(PARAMETER_CHANGE) else EFFECTS[kind].knowledge
