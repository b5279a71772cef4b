"""Kinds of effect from outside: what installed packages offer, and what a Python program offers for a while."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import entry_points
from inspect import isabstract
from types import MappingProxyType
from typing import Any, final

from delaytools.effects.effect import Effect
from delaytools.signals.trouble import DesignError, shown

__all__ = ["GROUP", "Kinds"]

GROUP = "delaytools.effects"
_NONE: Mapping[str, type[Effect]] = MappingProxyType({})
_OFFERED: ContextVar[Mapping[str, type[Effect]]] = ContextVar("offered effects", default=_NONE)


@final
@dataclass(frozen=True, eq=False)
class Kinds(Mapping[str, type[Effect]]):
    """Kinds of effect by name: the catalogue's own, those of `with_effects`, and those of installed packages.

    A package offers a class, or a module's several, under the entry point group `delaytools.effects`; it is loaded
    when a name is asked for that the catalogue has not, or when all are listed. Raises DesignError for what is
    no effect and for a name that is taken.
    """

    own: Mapping[str, type[Effect]]

    @cached_property
    def installed(self) -> Mapping[str, type[Effect]]:
        """What installed packages offer."""
        found: dict[str, type[Effect]] = {}
        for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
            where = f"entry point {point.name} = {point.value}"
            try:
                loaded = point.load()
            except (ImportError, AttributeError) as error:
                raise DesignError(f"an effect that cannot be loaded: {error}", where=where) from error
            kind = _checked(loaded, {**self.own, **found}, where)
            found[kind.kind] = kind
        return found

    def __getitem__(self, name: str) -> type[Effect]:
        if name in self.own:
            return self.own[name]
        offered = _OFFERED.get()
        return offered[name] if name in offered else self.installed[name]

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys((*self.own, *_OFFERED.get(), *self.installed)))

    def __len__(self) -> int:
        return len(tuple(iter(self)))

    @contextmanager
    def offered(self, *kinds: type[Effect]) -> Iterator[None]:
        """Within it, these kinds can be named as those of the catalogue; see `with_effects`."""
        known = dict(_OFFERED.get())
        for kind in kinds:
            checked = _checked(kind, {**self.own, **known}, shown(repr(kind)))
            known[checked.kind] = checked
        token = _OFFERED.set(known)
        try:
            yield
        finally:
            _OFFERED.reset(token)


def _checked(found: Any, taken: Mapping[str, Any], where: str) -> type[Effect]:
    if not (isinstance(found, type) and issubclass(found, Effect) and not isabstract(found)):
        advice = "offer a final class derived from delaytools.effects.effect.Effect"
        raise DesignError("this is no kind of effect", where=where, found=shown(repr(found)), advice=advice)
    lacks = [
        name for name in ("kind", "acts_on", "amplitude_dependent", "knowledge") if not hasattr(found, name)
    ]
    if lacks:
        raise DesignError(
            "a kind of effect that does not say all of itself", where=where, found=f"no {lacks[0]}"
        )
    if found.kind in taken:
        raise DesignError("the name of this effect is taken", where=where, found=repr(found.kind))
    return found
