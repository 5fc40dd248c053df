"""Robust, regularised least squares for a few unknowns and many complex residuals."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Residual = Callable[[NDArray[np.float64], bool], tuple[NDArray[np.complex128], NDArray[np.complex128] | None]]


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Independent normal priors; ``inf`` for none.

    Attributes
    ----------
    mean, std : ndarray (n,)
    """

    mean: NDArray[np.float64]
    std: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Result of a fit.

    Attributes
    ----------
    x : ndarray (n,)
        Best point found.
    cost : float
        Negative log posterior there, up to a constant.
    misfit : float
        Robust mean square of the weighted residuals.
    covariance : ndarray (n, n)
        Linearised covariance of x; the bounds count as uniform densities, and what is systematic in the
        residuals for fewer data than they are fitted with.
    n_iterations : int
    converged : bool
        False if the iterations ran out first.
    """

    x: NDArray[np.float64]
    cost: float
    misfit: float
    covariance: NDArray[np.float64]
    n_iterations: int
    converged: bool


def solve_robust(
    residual: Residual,
    x0: NDArray[np.float64],
    prior: Prior,
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    n_independent: float,
    floor: float,
    groups: NDArray[np.int64] | None = None,
    noise: NDArray[np.float64] | None = None,
    systematic: float = 1.0,
    counted: float = 1.0,
    robust: float = 0.5,
    max_iterations: int = 20,
    tolerance: float = 5e-3,
    max_step: float = 1.0,
    relative: NDArray[np.bool_] | bool = False,
) -> Solution:
    """Minimise a robust negative log posterior by Levenberg-Marquardt steps within bounds.

    Σ n_g/2 · ln(s² + ⟨ρ(|r|)⟩_g) + ½ Σ ((x - mean)/std)² with ρ = 2c² (√(1 + |r|²/c²) - 1), pseudo-Huber.

    The error level of each group g of residuals is estimated with the unknowns, which is what the logarithm
    says: while the misfit is large the priors hold, and when it is small the data speak; groups that a model
    cannot reach, such as high frequencies, count less.

    Parameters
    ----------
    residual : callable
        Gives r (m,) and, if asked, its Jacobian (n, m).
    x0 : ndarray (n,)
        Start.
    prior : Prior
    bounds : (ndarray (n,), ndarray (n,))
    n_independent : float
        How many independent data the residuals stand for.
    floor : float
        Residual level s below which nothing is gained [same unit as r].
    groups : ndarray of int (m,), optional
        Group of each residual; all in one unless given. Groups count by their size.
    noise : ndarray (m,), optional
        How much of each residual's square is put down to independent noise.
    systematic : float
        For how many of the independent data the rest stands, in multiples of them, in the covariance.
    counted : float
        For how many the noise stands there. Neither is of any effect without ``noise``.
    robust : float
        c, where the loss turns from quadratic to linear.
    max_iterations : int
    tolerance : float
        The iteration ends when the cost falls by less than this.
    max_step : float
        Longest step in each unknown in one iteration.
    relative : ndarray of bool (n,)
        Unknowns for which that is in parts of their size where this is more than 1.
    """
    lo, hi = bounds
    weight = np.where(np.isfinite(prior.std), 1 / prior.std**2, 0.0)
    mean = np.where(np.isfinite(prior.std), prior.mean, 0.0)

    def loss(r: NDArray[np.complex128]) -> NDArray[np.float64]:
        rho = 2 * robust**2 * (np.sqrt(1 + np.abs(r) ** 2 / robust**2) - 1)
        return np.bincount(member, rho, minlength=len(size)) / size

    def total(x: NDArray[np.float64], misfit: NDArray[np.float64]) -> float:
        return 0.5 * float(share @ np.log(floor**2 + misfit)) + 0.5 * float(weight @ (x - mean) ** 2)

    def normal(
        r: NDArray[np.complex128], J: NDArray[np.complex128], worth: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return Σ w J r and the normal equations' matrix, with what each group's residuals are worth."""
        w = worth[member] / np.sqrt(1 + np.abs(r) ** 2 / robust**2)
        JH, w2 = np.hstack([J.real, J.imag]), np.concatenate([w, w])
        return JH @ (w2 * np.concatenate([r.real, r.imag])), (JH * w2) @ JH.T + np.diag(weight)

    x = np.clip(x0, lo, hi)
    r, J = residual(x, True)
    assert J is not None
    member = np.zeros(len(r), dtype=np.int64) if groups is None else np.unique(groups, return_inverse=True)[1]
    size = np.bincount(member)
    share = n_independent * size / len(r)
    misfit = loss(r)
    cost = total(x, misfit)
    damping, converged, iteration = 1e-2, False, 0
    for iteration in range(1, max_iterations + 1):
        g, A = normal(r, J, n_independent / len(r) / (floor**2 + misfit))
        g = g + weight * (x - mean)
        pinned = ((x <= lo) & (g > 0)) | ((x >= hi) & (g < 0))
        free = ~pinned
        if not free.any():
            converged = True
            break
        improved = cut = False
        trial, misfit_new, cost_new = x, misfit, cost
        for attempt in range(8):
            scale = np.diag(A)[free]
            H = A[np.ix_(free, free)] + np.diag(
                damping * np.maximum(scale, 1e-12 * scale.max(initial=1e-300))
            )
            step = np.zeros_like(x)
            step[free] = -np.linalg.solve(H, g[free])
            if attempt == 0 and damping < 1 and -0.5 * float(g @ step) < tolerance:
                break
            reach = max_step * np.where(relative, np.maximum(1.0, np.abs(x)), 1.0)
            limits = np.maximum(-reach, lo - x)[free], np.minimum(reach, hi - x)[free]
            step[free] = step_within(step[free], H, g[free], limits)
            trial = np.clip(x + step, lo, hi)
            try:
                r_new, _ = residual(trial, False)
            except np.linalg.LinAlgError:  # no structure: more mass taken away than there is
                damping = min(damping * 8, 1e8)
                continue
            misfit_new = loss(r_new)
            cost_new = total(trial, misfit_new)
            if np.isfinite(cost_new) and cost_new < cost:
                improved, cut = True, bool((np.abs(step) >= reach).any())
                break
            damping = min(damping * 8, 1e8)
        if not improved:
            converged = True
            break
        gain = cost - cost_new
        x, misfit, cost = trial, misfit_new, cost_new
        damping = max(damping / 6, 1e-6)
        if gain < tolerance and not cut:
            converged = True
            break
        if iteration < max_iterations:
            r, J = residual(x, True)
            assert J is not None
    worth = n_independent / len(r) / (floor**2 + misfit)
    if noise is not None:
        independent = np.bincount(member, noise, minlength=len(size)) / size
        worth = worth / inflation(misfit, independent, floor, systematic, counted)
    _, A = normal(r, J, worth)
    # What the data leave open is as uncertain as its bounds are wide, those of a uniform density; an inverse
    # that leaves such directions out would call them certain.
    wide = np.isfinite(hi - lo) & (hi > lo) & (weight == 0)
    A = A + np.diag(np.where(wide, 12 / np.where(wide, hi - lo, 1.0) ** 2, 0.0))
    covariance: Any = np.linalg.pinv(A, hermitian=True)
    return Solution(x, cost, float(misfit @ size / len(r)), covariance, iteration, converged)


def step_within(
    goal: NDArray[np.float64],
    H: NDArray[np.float64],
    g: NDArray[np.float64],
    limits: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return a step towards the minimum of ½ pᵀ H p + gᵀ p that stays within limits.

    From 0 towards the minimum up to the first limit; the unknown that has met it stays there, and the others
    go on towards what is then their minimum. So one with a long way to go does not hold the others up, as it
    would if the whole step were shortened, and the quadratic falls all the way.

    Parameters
    ----------
    goal : ndarray (n,)
        The minimum without limits.
    H : ndarray (n, n)
        Positive definite.
    g : ndarray (n,)
    limits : (ndarray (n,), ndarray (n,))
        Of each unknown, with 0 between them.
    """
    lower, upper = limits
    at, held = np.zeros(len(goal)), np.zeros(len(goal), dtype=bool)
    while not held.all():
        move = goal - at
        room = np.where(move > 0, upper, lower) - at
        share = np.full(len(at), np.inf)
        np.divide(room, move, out=share, where=~held & (move != 0))
        first = int(np.argmin(share))
        if not share[first] < 1:
            return goal
        at = at + share[first] * move
        at[first], held[first] = (upper if move[first] > 0 else lower)[first], True
        rest, goal = ~held, at.copy()
        goal[rest] = -np.linalg.solve(H[np.ix_(rest, rest)], g[rest] + H[np.ix_(rest, held)] @ at[held])
    return at


def inflation(
    misfit: NDArray[np.float64] | float,
    noise: NDArray[np.float64] | float,
    floor: float,
    systematic: float,
    counted: float = 1.0,
) -> Any:
    """Return by what variances grow if noise stands for other than n data, and the rest for still others.

    q/counted + (1 - q)/systematic with q = min(1, (s² + noise)/(s² + misfit)), s the floor.

    Parameters
    ----------
    misfit, noise : ndarray or float
        Mean square of residuals, and how much of it is put down to independent noise.
    floor : float
    systematic, counted : float
        For how many times n data the rest and the noise stand.
    """
    share = np.minimum(1.0, (floor**2 + noise) / (floor**2 + misfit))
    return share / counted + (1 - share) / systematic
