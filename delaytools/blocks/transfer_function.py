"""A proper rational transfer function."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from delaytools.blocks.block import Continuous, Scalar, value
from delaytools.signals.trouble import DesignError

__all__ = ["TransferFunction"]


@final
@dataclass(frozen=True, kw_only=True)
class TransferFunction(Continuous):
    """(b₀ sⁿ + … + bₙ) / (a₀ sⁿ + … + aₙ), highest power first, proper.

    Realised in observable canonical form, whose first state is the output where the function is strictly
    proper; so b/(s + a) has the one state y with y' = b u - a y.
    """

    numerator: tuple[Scalar, ...] = value(many=True)
    denominator: tuple[Scalar, ...] = value(many=True)

    inputs = ("input",)
    outputs = ("output",)

    def __post_init__(self) -> None:
        if len(self.numerator) > len(self.denominator):
            raise DesignError(
                "the transfer function is not proper",
                found=f"degree {len(self.numerator) - 1} over degree {len(self.denominator) - 1}",
                advice="give a denominator of at least the numerator's degree",
            )
        if len(self.denominator) == 0 or (
            isinstance(self.denominator[0], float) and self.denominator[0] == 0
        ):
            raise DesignError(
                "the denominator's highest coefficient is zero", advice="leave leading zeros out"
            )

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.denominator) - 1

    @property
    def states(self) -> tuple[str, ...]:
        if self.order == 1:
            return ("output",)
        return tuple(f"x{k + 1}" for k in range(self.order))

    @property
    def initial_state(self) -> tuple[Scalar, ...]:
        return (0.0,) * self.order

    def _monic(self) -> tuple[list[Scalar], list[Scalar]]:
        lead = self.denominator[0]
        padded = [0.0] * (len(self.denominator) - len(self.numerator)) + list(self.numerator)
        return [b / lead for b in padded], [a / lead for a in self.denominator]

    def rate(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        b, a = self._monic()
        rates = []
        for k in range(self.order):
            following = x[k + 1] if k + 1 < self.order else 0.0
            rates.append(following - a[k + 1] * x[0] + (b[k + 1] - a[k + 1] * b[0]) * u[0])
        return tuple(rates)

    def output(self, t: Scalar, x: Sequence[Scalar], u: Sequence[Scalar]) -> tuple[Scalar, ...]:
        direct = self._monic()[0][0]
        state = x[0] if self.order else 0.0
        return (state + direct * u[0],)
