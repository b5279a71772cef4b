"""A named number that tuning and fitting may move."""

import math
from dataclasses import dataclass
from typing import final

from delaytools.signals.trouble import DelaytoolsError

__all__ = ["Parameter"]


@final
@dataclass(frozen=True)
class Parameter:
    """A value by its path in the design (`parameters.alpha`, `actuator.damping`), with bounds and a spread.

    value, low, high, std: in `unit`. std is NaN where it is not known.
    """

    path: str
    value: float
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    fixed: bool = False
    std: float = math.nan

    def __post_init__(self) -> None:
        if not self.low <= self.value <= self.high:
            raise DelaytoolsError(
                "a value outside its bounds",
                where=self.path,
                found=f"{self.value:g} not in [{self.low:g}, {self.high:g}]",
            )

    @property
    def at_boundary(self) -> bool:
        """Whether the value lies on one of its bounds."""
        return self.value in (self.low, self.high)
