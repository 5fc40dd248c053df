"""What a fit needs of the cost of its residuals."""

from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray


class Costs(Protocol):
    """A negative log likelihood by the mean squares of groups of residuals."""

    @property
    def noise(self) -> NDArray[np.float64]:
        """Mean squares that noise leaves, (n_groups,)."""
        ...

    @property
    def believed(self) -> Self:
        """The same where every reading belongs to the structure's model."""
        ...

    def cost(self, v: NDArray[np.float64]) -> float:
        """Return the negative log likelihood at mean squares (n_groups,)."""
        ...

    def costs(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the negative log likelihoods at several sets of mean squares, (..., n_groups)."""
        ...

    def weight(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return twice its derivatives by the mean squares, (..., n_groups)."""
        ...

    def gain(self, v: NDArray[np.float64], least: NDArray[np.float64]) -> float:
        """Return by how much the log likelihood would rise with mean squares no larger than the least."""
        ...

    def is_bad(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the probability that the readings of each group are bad ones, (..., n_groups)."""
        ...
