"""The posterior of a fit linearised at a point: for selection, regularisation, deviations and samples."""

from collections.abc import Callable

import numpy as np

from fem.array_types import Bools, Floats, Ints
from updating.inference.determined import split_covariance
from updating.inference.fit_function import ROBUST, FitFunction
from updating.inference.fitting import FLAT
from updating.inference.marginal import Quadratic
from updating.inference.solve import Prior
from updating.least_squares.costs import Costs, DenseJacobian, pseudo_huber_weight


def whitened(function: FitFunction, levels: Costs, x: Floats, rows: Ints) -> tuple[Floats, Floats]:
    """Return the linear problem A d ≈ -r of some unknowns; all others are projected out with their priors.

    Parameters
    ----------
    function : FitFunction
    levels : Costs
    x : ndarray (n,)
    rows : ndarray of int (k,)
        The unknowns.

    Returns
    -------
    ndarray (m, k), ndarray (m,)
        In standard deviations of the stated noise.
    """
    r, J = function(x, True)
    assert J is not None
    member = np.unique(function.groups, return_inverse=True)[1]
    worth = levels.weight(levels.noise) / np.bincount(member)
    root = np.sqrt(worth[member] * pseudo_huber_weight(r, ROBUST))
    A = np.hstack([J.real * root, J.imag * root]).T
    b = np.concatenate([r.real * root, r.imag * root])
    others = np.setdiff1d(np.arange(len(x)), rows)
    if not others.size:
        return A[:, rows], b
    prior = function.prior()
    know = 1 / np.minimum(prior.std, FLAT)[others]
    Q = np.linalg.qr(np.vstack([A[:, others], np.diag(know)]))[0]
    A = np.vstack([A[:, rows], np.zeros((others.size, len(rows)))])
    b = np.concatenate([b, know * (x - prior.mean)[others]])
    return A - Q @ (Q.T @ A), b - Q @ (Q.T @ b)


def stated_quadratic(function: FitFunction, levels: Costs, x: Floats) -> tuple[Floats, Floats]:
    """Return slopes (n,) and curvature (n, n) at x of the cost with residuals counted by their noise."""
    prior, near = function.prior(), function.quadratic(x, levels)
    worth, std = levels.weight(levels.noise), np.minimum(prior.std, FLAT)
    off = np.where(np.isfinite(prior.std), x - prior.mean, 0.0)
    return worth @ near.slope + off / std**2, near.normal(worth, std)


def covariance_of(
    function: FitFunction, levels: Costs, x: Floats, std: Floats, precision: Floats | None, fixed: Bools
) -> tuple[Floats, Floats]:
    """Return the covariance (n, n) of unknowns, and the directions (n, k) that the data do not determine.

    Parameters
    ----------
    function : FitFunction
    levels : Costs
    x : ndarray (n,)
        The most probable unknowns.
    std : ndarray (n,)
        Of the priors; infinite for none.
    precision : ndarray (n, n) or None
        Of a regularisation.
    fixed : ndarray of bool (n,)
        Unknowns that are fixed, as at a bound: their rows are 0.
    """
    near = function.quadratic(x, levels)
    A = near.normal(levels.weight(near.v), std)
    return split_covariance(A if precision is None else A + precision, widths_of(function), std**-2.0, fixed)


def widths_of(function: FitFunction) -> Floats:
    """Return the possible errors of all unknowns, (n,): the priors' deviations, or what is assumed."""
    prior = function.prior()
    widths = [v.width for v in function.variables]
    return np.concatenate([widths, prior.std[len(widths) :]])


def marginal_density(
    function: FitFunction, levels: Costs, x: Floats, rows: Ints, prior: Prior
) -> Callable[[Floats], float]:
    """Return the logarithm of the posterior density of some unknowns (k,), up to a constant.

    All others are where they are most probable beside these, by derivatives at x: Laplace's approximation of
    their integral, but for its change over x.
    """
    others = np.setdiff1d(np.arange(len(x)), rows)
    _, J = function(x, True)
    assert J is not None
    slopes, member = J[others], np.unique(function.groups, return_inverse=True)[1]
    std, mean = np.minimum(prior.std, FLAT)[others], prior.mean[others]

    def density(part: Floats) -> float:
        at = x.copy()
        at[rows] = part
        r, _ = function(at, False)
        near = Quadratic.of(r, DenseJacobian(slopes), member, ROBUST, levels)
        change = near.settled(x[others] - mean, std).change if others.size else np.zeros(0)
        at[others] += change
        return -levels.cost(near.at(change)) - prior.cost(at)

    return density
