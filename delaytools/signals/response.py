"""A frequency response: complex gain over frequency between two signals."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Response"]


@final
@dataclass(frozen=True)
class Response:
    """frequency: (n,) rad/s; value: (n,) complex, output per input."""

    frequency: NDArray[np.float64]
    value: NDArray[np.complex128]
    input: str = "u"
    output: str = "y"

    @property
    def gain(self) -> NDArray[np.float64]:
        """|G(jω)|, (n,)."""
        return np.abs(self.value)

    @property
    def phase(self) -> NDArray[np.float64]:
        """Unwrapped arg G(jω), (n,) rad."""
        return np.unwrap(np.angle(self.value))
