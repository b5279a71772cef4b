"""The words of trouble: every error says what was wrong, the value found, what is known and what to do."""

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["AnalysisError", "DelaytoolsError", "DesignError", "LogError", "UnitError", "nearest", "shown"]


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name nearest to `name`, or an empty string where none resembles it."""
    matches = get_close_matches(name, list(known), n=1, cutoff=0.5)
    return matches[0] if matches else ""


def shown(item: object, length: int = 80) -> str:
    """What was found, as a message quotes it: cut where it is long."""
    text = repr(item)
    return text if len(text) <= length else f"{text[: length - 2]}…{text[-1]}"


class DelaytoolsError(Exception):
    """Something the user can put right: where it is, what is wrong, what is known, what to do.

    each: the single faults, where one error stands for several.
    """

    each: "tuple[DelaytoolsError, ...]" = ()

    def __init__(
        self,
        problem: str,
        *,
        where: str = "",
        found: str = "",
        known: Iterable[str] = (),
        advice: str = "",
    ) -> None:
        known = tuple(known)
        self.problem, self.where, self.found, self.known, self.advice = problem, where, found, known, advice
        super().__init__(self._sentence())

    def _sentence(self) -> str:
        parts = [f"{self.where}: {self.problem}" if self.where else self.problem]
        if self.found:
            parts.append(f"found {self.found}")
        if self.known:
            parts.append("known: " + ", ".join(self.known))
            close = nearest(self.found.strip("'\""), self.known) if self.found else ""
            if close:
                parts.append(f"nearest: {close}")
        if self.advice:
            parts.append(self.advice)
        return "; ".join(parts)

    def at(self, where: str) -> "DelaytoolsError":
        """The same trouble, with the place put in front of the place it already names."""
        place = f"{where}: {self.where}" if self.where else where
        new = type(self)(self.problem, where=place, found=self.found, known=self.known, advice=self.advice)
        new.each = tuple(error.at(where) for error in self.each)
        return new


class UnitError(DelaytoolsError):
    """A quantity whose unit is unknown or of the wrong dimension."""


class DesignError(DelaytoolsError):
    """A design that does not describe a loop."""


class LogError(DelaytoolsError):
    """A log that cannot be read as a record of signals."""


class AnalysisError(DelaytoolsError):
    """A question that has no answer for this loop."""
