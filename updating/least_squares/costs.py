"""What a fit needs of the cost of its residuals."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Costs(Protocol):
    """A negative log likelihood by the mean squares of groups of residuals."""

    @property
    def noise(self) -> NDArray[np.float64]:
        """Mean squares that noise leaves, (n_groups,)."""
        ...

    def cost(self, v: NDArray[np.float64]) -> float:
        """Return the negative log likelihood at mean squares (n_groups,)."""
        ...

    def weight(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return twice its derivatives by the mean squares, (n_groups,)."""
        ...

    def gain(self, v: NDArray[np.float64], least: NDArray[np.float64]) -> float:
        """Return by how much the log likelihood would rise with mean squares no larger than the least."""
        ...
