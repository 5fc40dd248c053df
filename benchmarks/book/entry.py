"""Entries of the benchmark book, and their comparison with computed numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import ArrayLike, NDArray

SAME = 1e-3
"""Relative difference of two deviations below which they are the same [-]."""
ROUNDING = 1.02
"""Halves of the last digit that rounding may take; printed numbers of single precision may round up twice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """Numbers of one kind, as the source prints them.

    Attributes
    ----------
    name, unit : str
    printed : str
        Numbers with spaces between them; their digits state how accurate they are.
    allowance : float
        Deviation that is expected beyond half of the last digit, relative to the largest number [-].
    reason : str
        Cause of that deviation.
    exact : callable or None
        Computes the right numbers where those that are printed are wrong.
    proof : str
        Why these are wrong.
    """

    name: str
    unit: str
    printed: str
    allowance: float = 0.0
    reason: str = ""
    exact: Callable[[], ArrayLike] | None = None
    proof: str = ""

    def __post_init__(self) -> None:
        if (self.allowance > 0) != bool(self.reason):
            msg = f"{self.name}: an allowance needs a reason, and a reason an allowance"
            raise ValueError(msg)
        if (self.exact is not None) != bool(self.proof):
            msg = f"{self.name}: a printed number is wrong only with the right one and a proof"
            raise ValueError(msg)

    @property
    def numbers(self) -> NDArray[np.float64]:
        """The printed numbers."""
        return np.array([float(word) for word in self.printed.split()])

    @property
    def half_digits(self) -> NDArray[np.float64]:
        """Half of the last digit of each number."""
        return np.array([half_digit(word) for word in self.printed.split()])

    @property
    def allowed(self) -> NDArray[np.float64]:
        """The largest deviation of each number from the reference that counts as agreement."""
        return ROUNDING * self.half_digits + self.allowance * np.abs(self.numbers).max()

    @property
    def reference(self) -> NDArray[np.float64]:
        """The printed numbers, or the right ones where they are wrong."""
        return self.numbers if self.exact is None else np.array(self.exact(), dtype=float).ravel()


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A published problem.

    Attributes
    ----------
    name : str
        Name in its source.
    title : str
    quantities : tuple of Quantity
    compute : callable
        Returns Dovetail's numbers for each quantity.
    remark : str
        A sentence about the comparison.
    """

    name: str
    title: str
    quantities: tuple[Quantity, ...]
    compute: Callable[[], Sequence[ArrayLike]]
    remark: str = ""


@dataclass(frozen=True, slots=True)
class Compared:
    """A quantity beside Dovetail's numbers."""

    quantity: Quantity
    ours: NDArray[np.float64]

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Difference of Dovetail's numbers from the reference."""
        return self.ours - self.quantity.reference

    @property
    def agrees(self) -> bool:
        """Whether all deviations are allowed, and a number that is called wrong deviates by more."""
        q = self.quantity
        wrong = q.exact is None or bool((np.abs(q.numbers - q.reference) > q.allowed).any())
        return bool((np.abs(self.deviation) <= q.allowed).all()) and wrong

    @property
    def worst(self) -> int:
        """Index of the number with the largest deviation in units of the allowed one."""
        size = np.abs(self.deviation) / self.quantity.allowed
        # of numbers that symmetry makes equal the first, on every processor
        return int(np.argmax(size >= (1 - SAME) * size.max()))

    @property
    def shown(self) -> int:
        """Index of the number that a table shows: of printed numbers that are wrong, the most wrong one."""
        q = self.quantity
        return self.worst if q.exact is None else int(np.argmax(np.abs(q.numbers / q.reference - 1)))


def compare(problem: Problem) -> tuple[Compared, ...]:
    """Compute the numbers of a problem and pair them with those that are printed."""
    computed = problem.compute()
    pairs = zip(problem.quantities, computed, strict=True)
    out = tuple(Compared(q, np.array(values, dtype=float).ravel()) for q, values in pairs)
    for c in out:
        if c.ours.shape != c.quantity.numbers.shape:
            msg = f"{problem.name}, {c.quantity.name}: {c.ours.size} numbers for {c.quantity.numbers.size}"
            raise ValueError(msg)
    return out


def half_digit(word: str) -> float:
    """Return half a unit of the last digit of a printed number."""
    return 0.5 * 10.0 ** int(Decimal(word).as_tuple().exponent)
