"""What data that are still to come tell: changes beyond all that may vary, and the gains to be expected."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats
from updating.least_squares.costs import Costs

N_DOUBLED, N_HALVED = 8, 20
"""Steps that enclose a multiple, and halves of the range in which it then is."""

SMALL = 1e-9
"""What is known of an unknown is no less than this share of it: of two that do the same [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Beyond:
    """Some changes without what the unknowns can do of them.

    Attributes
    ----------
    squares : ndarray (k, n_groups)
        Sums of the weighted squares that are left in each group.
    known : ndarray (k,)
        Half the squares of what is known beforehand of the unknowns.
    products : ndarray (k, m)
        Inner products with all changes, in the metric of the data and of what is known.
    lengths : ndarray (m,)
        Squares of the lengths of all changes there.
    """

    squares: Floats
    known: Floats
    products: Floats
    lengths: Floats

    @property
    def cosines_squared(self) -> Floats:
        """Squares of the cosines of the angles between some changes and all, (k, m)."""
        lengths = np.maximum(self.lengths, 1e-300)
        return np.minimum(self.products**2 / lengths[: len(self.products), None] / lengths, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    """Information of data on unknowns and on changes of the data; that of several data adds up.

    Attributes
    ----------
    unknowns : ndarray (n_groups, u, u + m)
        Inner products, over the weighted residuals of each group, of what the unknowns do with what they and
        the changes do.
    squares : ndarray (n_groups, k)
        Squares of the first changes.
    products : ndarray (k, m)
        Inner products of the first changes with all, over all groups.
    lengths : ndarray (m,)
        Squares of all changes, over all groups.
    """

    unknowns: NDArray[np.floating]
    squares: NDArray[np.floating]
    products: NDArray[np.floating]
    lengths: NDArray[np.floating]

    @classmethod
    def of(cls, rows: Sequence[NDArray[np.floating]], u: int, n: int) -> "Information":
        """Return the information of weighted residuals.

        Parameters
        ----------
        rows : sequence of ndarray (u + m, n_residuals)
            Of each group: what u unknowns and, behind them, the changes do.
        u, n : int
            Number of unknowns, and of the first changes.
        """
        return cls(
            np.array([x[:u] @ x.T for x in rows]),
            np.array([(x[u : u + n] ** 2).sum(axis=1) for x in rows]),
            np.sum([x[u : u + n] @ x[u:].T for x in rows], axis=0),
            np.sum([(x[u:] ** 2).sum(axis=1) for x in rows], axis=0),
        )

    @classmethod
    def of_matrix(cls, information: Floats, u: int, n: int) -> "Information":
        """Return the information whose inner products (u + m, u + m) are known, in one group."""
        diagonal, some = np.diag(information)[u:], information[u : u + n, u:]
        return cls(information[None, :u], diagonal[None, :n], some, diagonal)

    def __add__(self, other: "Information") -> "Information":
        """Return the information of the data of both."""
        return Information(
            self.unknowns + other.unknowns,
            self.squares + other.squares,
            self.products + other.products,
            self.lengths + other.lengths,
        )

    def beyond(self, known: Floats) -> Beyond:
        """Return the first changes beyond what the unknowns can do, of a precision (u, u) beforehand."""
        u, n = len(known), self.squares.shape[1]
        each = np.asarray(self.unknowns, dtype=float)
        A = each.sum(axis=0)
        C = np.linalg.solve(A[:, :u] + known, A[:, u:])
        products = self.products - A[:, u : u + n].T @ C
        lengths = np.maximum(self.lengths - (A[:, u:] * C).sum(axis=0), 0.0)
        c = C[:, :n]
        squares = self.squares.T - 2 * np.einsum("guk,uk->kg", each[:, :, u : u + n], c)
        squares += np.stack([(c * (B[:, :u] @ c)).sum(axis=0) for B in each], axis=1)
        prior = 0.5 * (c * (known @ c)).sum(axis=0)
        return Beyond(np.maximum(squares, 0.0), prior, products, lengths)

    def learned(self, known: Floats) -> tuple[Floats, Floats]:
        """Return :func:`learned` of the unknowns, of a precision (u, u) beforehand."""
        return learned(self.unknowns[:, :, : len(known)], known)


def learned(information: NDArray[np.floating], known: Floats) -> tuple[Floats, Floats]:
    """Return what data say of combinations of unknowns, (u,), and each group's part, (u, n_groups).

    Shares of all that is known of them afterwards. With a smaller misfit data say more, and the evidence
    takes more for parameters that are free.

    Parameters
    ----------
    information : ndarray (n_groups, u, u)
        Of each group of residuals on the unknowns.
    known : ndarray (u, u)
        Precision beforehand.
    """
    total = information.sum(axis=0) + known
    size = np.sqrt(np.where(total.diagonal() > 0, total.diagonal(), 1.0))
    units = np.outer(size, size)
    L = np.linalg.cholesky(total / units + SMALL * np.eye(len(size)))
    parts = [np.linalg.solve(L, np.linalg.solve(L, A / units).T) for A in information]
    values, U = np.linalg.eigh(np.sum(parts, axis=0))
    return np.clip(values, 0.0, 1.0), np.stack([((B @ U) * U).sum(axis=0) for B in parts], axis=1)


def without(information: Floats, known: Floats) -> Floats:
    """Return information (n, n) without its first unknowns, of which a precision (u, u) is known."""
    u = len(known)
    across = information[:u, u:]
    out: Floats = information[u:, u:] - across.T @ np.linalg.solve(information[:u, :u] + known, across)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedGains:
    """Expected gains in log evidence of a model that has a change over one that lacks it.

    ½ (a |v|)² as long as the change is small beside what a right model leaves; beyond, its logarithm. With a
    larger misfit data say less of the unknowns, and the evidence takes less for parameters that are free:
    that counts for the wrong model.

    Attributes
    ----------
    levels : Costs
    level : ndarray (n_groups,)
        Mean squares of the residuals that a right model leaves.
    learned, by_group : ndarray (u,), (u, n_groups)
        As of :meth:`Information.learned`; without them unknowns cost both models the same.
    """

    levels: Costs
    level: Floats
    learned: Floats = field(default_factory=lambda: np.zeros(0))
    by_group: Floats | None = None

    def slope(self, squares: Floats, known: Floats) -> Floats:
        """Return gains of very small changes over the squares of their multiples, (n,)."""
        out: Floats = 0.5 * squares @ self.levels.weight(self.level) + known
        return out

    def gains(self, a: Floats, squares: Floats, known: Floats) -> Floats:
        """Return the expected gains (n,) of multiples (n,) of changes [nats].

        Parameters
        ----------
        a : ndarray (n,)
        squares : ndarray (n, n_groups)
            Mean squares of the changes beyond all that may vary.
        known : ndarray (n,)
            As of :class:`Beyond`.
        """
        levels, v = self.levels, self.level + a[:, None] ** 2 * squares
        out: Floats = levels.costs(v) - levels.cost(self.level) + a**2 * known
        if self.by_group is not None:
            weaker = levels.weight(v) / levels.weight(self.level)
            out += 0.5 * np.log(1 - self.learned + weaker @ self.by_group.T + 1e-12).sum(axis=1)
        return out

    def multiples(self, squares: Floats, known: Floats, wanted: Floats, n_halved: int = N_HALVED) -> Floats:
        """Return the least multiples (n,) that gain what is wanted (n,) [nats]; infinite if none does."""
        slope = self.slope(squares, known)
        seen = slope > 0
        low = np.where(
            seen, np.sqrt(wanted / np.where(seen, slope, 1.0)), 1.0
        )  # gains are at most linear in a²
        high = low.copy()
        for _ in range(N_DOUBLED):
            short = self.gains(high, squares, known) < wanted
            if not short.any():
                break
            low, high = np.where(short, high, low), np.where(short, 2 * high, high)
        seen &= (
            self.gains(high, squares, known) >= wanted
        )  # of more parameters than data nothing is ever seen
        for _ in range(n_halved):
            middle = np.sqrt(low * high)
            short = self.gains(middle, squares, known) < wanted
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return np.where(seen, high, np.inf)
