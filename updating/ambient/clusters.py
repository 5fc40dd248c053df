"""Modes among the poles of all orders: groups of poles that are one pole within their deviations."""

from dataclasses import dataclass

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from updating.ambient.subspace import SubspacePoles

CONFIDENCE = 3.0
"""Largest distance of equal poles of two orders, in standard deviations of the difference."""

LEAST_SHARE = 0.5
"""Orders in which a mode has to be found, in parts of the orders from that of the record on [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Cluster:
    """One mode's poles over the orders.

    Attributes
    ----------
    members : ndarray of int (n,)
        Indices of the poles, at most one of each order, rising.
    weight : ndarray (n,)
        Weights of their mean, the inverse of their variances, with a sum of 1 [-].
    """

    members: Ints
    weight: Floats


def pole_std(deviation: Complexes) -> Floats:
    """Return the standard deviation |Δλ| of poles whose blocks deviate so, (n,) of (n, n_blocks)."""
    n = deviation.shape[-1]
    return np.sqrt((np.abs(deviation) ** 2).sum(axis=-1) / (n * (n - 1)))


def determined(found: SubspacePoles) -> Bools:
    """Return which poles are known better than their own half-power half-width.

    The others are as likely poles of the noise: in a model of too high an order they take any place, so that
    a slightly different record moves them by more than their width.
    """
    return pole_std(found.pole_deviation) < -found.poles.real


def clusters_of(found: SubspacePoles, order: int) -> tuple[Cluster, ...]:
    """Gather poles of one mode, from the best known pole on; return groups that last, by frequency.

    Orders below that of the record leave out modes, which moves the others: their poles tell that a mode
    lasts, and no more. Blocks give the deviations of two poles together, so also that of their difference:
    two orders have the same mode if their poles differ by less than chance. No frequency or damping ratio is
    compared with a fixed step.

    Parameters
    ----------
    found : SubspacePoles
    order : int
        That of the record.
    """
    std = pole_std(found.pole_deviation)
    free = determined(found)
    high = found.order >= order
    least = LEAST_SHARE * np.count_nonzero(found.orders >= order)
    out: list[Cluster] = []
    for seed in np.argsort(std / np.maximum(-found.poles.real, 1e-300)):
        if not (free[seed] and high[seed]):
            continue
        members = _like(found, int(seed), free)
        free[members] = False
        if len(members) >= least:
            members = members[high[members]]
            weight = std[members] ** -2
            out.append(Cluster(members, weight / weight.sum()))
    return tuple(sorted(out, key=lambda c: float(abs(found.poles[c.members] @ c.weight))))


def _like(found: SubspacePoles, seed: int, free: Bools) -> Ints:
    """Return the free poles that are the seed's within chance, the nearest of each order."""
    rows = np.flatnonzero(free)
    apart = np.abs(found.poles[rows] - found.poles[seed])
    chance = pole_std(found.pole_deviation[rows] - found.pole_deviation[seed])
    rows, apart = rows[apart <= CONFIDENCE * chance], apart[apart <= CONFIDENCE * chance]
    nearest: dict[int, int] = {}
    for k in np.argsort(apart):
        nearest.setdefault(int(found.order[rows[k]]), int(rows[k]))
    return np.array(sorted({*nearest.values(), seed}))
