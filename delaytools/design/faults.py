"""Collecting every fault of a design before saying so, all at once."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import final

from delaytools.signals.trouble import DelaytoolsError, DesignError

__all__ = ["Faults"]


@final
class Faults:
    """Gathers errors by place; `settle` raises one error that names them all."""

    def __init__(self, file: str = "") -> None:
        self.file = file
        self.found: list[DelaytoolsError] = []

    @contextmanager
    def at(self, place: str) -> Iterator[None]:
        """Errors inside are kept, with the place put in front of them."""
        try:
            yield
        except DelaytoolsError as error:
            for single in error.each or (error,):
                self.found.append(single.at(place) if place else single)

    def settle(self) -> None:
        """Raise what was found, if anything was."""
        if len(self.found) == 1:
            raise self.found[0].at(self.file) if self.file else self.found[0]
        if self.found:
            lines = "\n".join(f"  {error}" for error in self.found)
            whole = DesignError(f"{len(self.found)} faults\n{lines}", where=self.file)
            whole.each = tuple(self.found)
            raise whole
