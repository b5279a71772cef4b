"""The transcendental elements of a linear system with delay: a transport and a hold."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import factorial
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from delaytools.signals.trouble import AnalysisError

__all__ = ["Channel", "Delay", "Hold"]

ComplexArray = NDArray[np.complex128]

_SERIES_RADIUS = 1.0
_SERIES = [(-1.0) ** k * k / factorial(k + 1) for k in range(1, 22)]  # of phi'(x), truncated below 1e-20


class Channel(ABC):
    """A scalar entire function of s with value 1 at s = 0: c(s) = kappa(s span), `span` in seconds.

    Arrays in, complex arrays of the same shape out. The scaled forms hold the factor e^{s span}, so that nothing
    overflows where Re s < 0.
    """

    @property
    @abstractmethod
    def span(self) -> float:
        """The seconds of the past that the channel remembers."""

    def value(self, s: Any) -> ComplexArray:
        """c(s)."""
        return self.kappa(_complex(s) * self.span)

    @abstractmethod
    def with_span(self, span: float) -> "Channel":
        """The same kind of channel over another span."""

    @abstractmethod
    def kappa(self, x: Any, *, scaled: bool = False) -> ComplexArray:
        """kappa(x), of x = s span without unit; times e^x where `scaled`."""

    @abstractmethod
    def kappa_derivative(self, x: Any, *, scaled: bool = False) -> ComplexArray:
        """d/dx of what `kappa` gives."""


@final
@dataclass(frozen=True)
class Delay(Channel):
    """A transport: c(s) = e^{-s tau}, tau = `seconds` >= 0.

    Raises AnalysisError where tau is negative or not finite.
    """

    seconds: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.seconds) and self.seconds >= 0):
            raise AnalysisError("a delay must be finite and not negative", found=f"{self.seconds} s")
        object.__setattr__(self, "seconds", float(self.seconds))

    @property
    def span(self) -> float:
        """tau."""
        return self.seconds

    def with_span(self, span: float) -> "Delay":
        """A transport of `span` seconds."""
        return Delay(span)

    def kappa(self, x: Any, *, scaled: bool = False) -> ComplexArray:
        """e^{-x}, or 1 scaled."""
        return np.ones_like(_complex(x)) if scaled else np.exp(-_complex(x))

    def kappa_derivative(self, x: Any, *, scaled: bool = False) -> ComplexArray:
        """-e^{-x}, or 0 scaled."""
        return np.zeros_like(_complex(x)) if scaled else -np.exp(-_complex(x))


@final
@dataclass(frozen=True)
class Hold(Channel):
    """The mean over the last T seconds: c(s) = (1 - e^{-sT})/(sT), T = `period` > 0.

    kappa(x) = phi(x) = (1 - e^{-x})/x, phi(0) = 1: the continuous approximation of sampling and holding at period T.
    Raises AnalysisError where T <= 0.
    """

    period: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.period) and self.period > 0):
            raise AnalysisError("a hold's period must be positive and finite", found=f"{self.period} s")
        object.__setattr__(self, "period", float(self.period))

    @property
    def span(self) -> float:
        """T."""
        return self.period

    def with_span(self, span: float) -> "Hold":
        """A hold of `span` seconds."""
        return Hold(span)

    def kappa(self, x: Any, *, scaled: bool = False) -> ComplexArray:
        """phi(x), or phi(-x) scaled."""
        return _phi(-_complex(x) if scaled else _complex(x))

    def kappa_derivative(self, x: Any, *, scaled: bool = False) -> ComplexArray:
        """phi'(x), or -phi'(-x) scaled."""
        return -_phi_derivative(-_complex(x)) if scaled else _phi_derivative(_complex(x))


def _complex(s: Any) -> ComplexArray:
    return np.asarray(s, dtype=complex)


def _phi(x: ComplexArray) -> ComplexArray:
    """(1 - e^{-x})/x; expm1 keeps full relative accuracy near x = 0 and near x = 2 pi i k."""
    at_zero = x == 0
    safe = np.where(at_zero, 1.0, x)
    return np.where(at_zero, 1.0, -np.expm1(-safe) / safe)


def _phi_derivative(x: ComplexArray) -> ComplexArray:
    """phi'(x) = (e^{-x} - phi(x))/x, by its power series where |x| < 1."""
    near = np.abs(x) < _SERIES_RADIUS
    safe = np.where(near, 1.0, x)
    inside = np.where(near, x, 0.0)
    series = np.polynomial.polynomial.polyval(inside, _SERIES)
    return np.where(near, series, (np.exp(-safe) - _phi(safe)) / safe)
