"""What a fit needs of the cost of its residuals."""

from typing import Protocol, Self

from fem.array_types import Floats


class Costs(Protocol):
    """A negative log likelihood by the mean squares of groups of residuals."""

    @property
    def noise(self) -> Floats:
        """Mean squares that noise leaves, (n_groups,)."""
        ...

    @property
    def believed(self) -> Self:
        """The same where every reading belongs to the structure's model."""
        ...

    def cost(self, v: Floats) -> float:
        """Return the negative log likelihood at mean squares (n_groups,)."""
        ...

    def costs(self, v: Floats) -> Floats:
        """Return the negative log likelihoods at several sets of mean squares, (..., n_groups)."""
        ...

    def weight(self, v: Floats) -> Floats:
        """Return twice its derivatives by the mean squares, (..., n_groups)."""
        ...

    def gain(self, v: Floats, least: Floats) -> float:
        """Return by how much the log likelihood would rise with mean squares no larger than the least."""
        ...

    def is_bad(self, v: Floats) -> Floats:
        """Return the probability that the readings of each group are bad ones, (..., n_groups)."""
        ...
