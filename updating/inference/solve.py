"""Robust, regularised least squares for a few unknowns and many complex residuals."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.summary import fields_summary
from updating.least_squares.costs import Costs, DenseJacobian, Jacobian, pseudo_huber, pseudo_huber_weight
from updating.least_squares.levenberg_marquardt import Control, Linearisation, Stop, Tolerance, minimise

Residual = Callable[[Floats, bool], tuple[Complexes, Complexes | None]]
Linearised = Callable[[Floats], tuple[Complexes, Jacobian]]

ROUNDING = 1e-7
"""Change of the data by one unit of an unknown that is put down to rounding [standard deviations]."""
TOLERANCE = 5e-3
"""A fit ends when a step gains less [nats]."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Independent normal priors; ``inf`` for none.

    Attributes
    ----------
    mean, std : ndarray (n,)
    precision : ndarray (n, n) or None
        Weight of a regularisation beside them, about ``about`` (n,).
    """

    mean: Floats
    std: Floats
    precision: Floats | None = None
    about: Floats | None = None

    @property
    def information(self) -> Floats:
        """Second derivatives of the negative log prior, (n, n)."""
        independent = np.diag(self.std**-2.0)
        return independent if self.precision is None else independent + self.precision

    def slope(self, x: Floats) -> Floats:
        """Return its slopes at x, (n,)."""
        independent = self.std**-2.0 * np.where(np.isfinite(self.std), x - self.mean, 0.0)
        if self.precision is None or self.about is None:
            return independent
        return independent + self.precision @ (x - self.about)

    def cost(self, x: Floats) -> float:
        """Return the negative log prior at x, up to a constant."""
        independent = 0.5 * float(self.std**-2.0 @ np.where(np.isfinite(self.std), x - self.mean, 0.0) ** 2)
        if self.precision is None or self.about is None:
            return independent
        return independent + 0.5 * float((x - self.about) @ self.precision @ (x - self.about))


Report = Callable[[Floats, float], None]
"""Called after each step with the unknowns (n,) and the cost."""


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
    n_iterations : int
    converged : bool
        False if the iterations ran out first.
    covariance : ndarray (n, n)
        Of x by a normal approximation; empty until :func:`updating.inference.fitting.with_evidence`.
    """

    x: Floats
    cost: float
    misfit: float
    n_iterations: int
    converged: bool
    covariance: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    __repr__ = fields_summary


def solve_robust(
    residual: Residual,
    x0: Floats,
    prior: Prior,
    bounds: tuple[Floats, Floats],
    *,
    levels: Costs,
    groups: Ints | None = None,
    linearised: Linearised | None = None,
    robust: float = 0.5,
    max_iterations: int = 20,
    tolerance: float = TOLERANCE,
    max_step: float = 1.0,
    relative: Bools | bool = False,
    report: Report | None = None,
) -> Solution:
    """Minimise a robust negative log posterior by Levenberg-Marquardt steps within bounds.

    The levels' cost of ⟨ρ(|r|)⟩_g, such as Σ n_g/2 · ln(s² + ⟨ρ(|r|)⟩_g), and ½ Σ ((x - mean)/std)², with
    ρ = 2c² (√(1 + |r|²/c²) - 1), pseudo-Huber.

    The error level of each group g of residuals is estimated with the unknowns, hence the
    logarithm: while the misfit is large the priors hold, and when it is small the data speak; groups that a
    model cannot reach, such as high frequencies, count less.

    Parameters
    ----------
    residual : callable
        Gives r (m,) and, if asked, its Jacobian (n, m).
    x0 : ndarray (n,)
        Start.
    prior : Prior
    bounds : (ndarray (n,), ndarray (n,))
    levels : Levels
        Cost of the groups' mean squares, in the order of the groups' numbers.
    groups : ndarray of int (m,), optional
        Group of each residual; all in one unless given. Groups count by their size.
    linearised : callable, optional
        Gives r and its :class:`updating.least_squares.costs.Jacobian` where that is not a dense array.
    robust : float
        c, where the loss turns from quadratic to linear.
    max_iterations : int
    tolerance : float
        The iteration ends when the cost falls by less than this.
    max_step : float
        Longest step in each unknown in one iteration.
    relative : ndarray of bool (n,)
        Unknowns for which that is in parts of their size where this is more than 1.
    report : callable, optional
    """
    lo, hi = bounds
    x = np.clip(x0, lo, hi)

    def dense(x: Floats) -> tuple[Complexes, Jacobian]:
        r, J = residual(x, True)
        assert J is not None
        return r, DenseJacobian(J)

    r, J = (linearised or dense)(x)
    member = np.zeros(len(r), dtype=np.int64) if groups is None else np.unique(groups, return_inverse=True)[1]
    size = np.bincount(member)
    posterior = _Posterior(residual, linearised or dense, prior, levels, member, size, robust)
    control = Control(
        reach=lambda x: max_step * np.where(relative, np.maximum(1.0, np.abs(x)), 1.0),
        promised_gain=Tolerance(tolerance),
        actual_gain=Tolerance(tolerance),
        max_iterations=max_iterations,
        max_trials=8,
        damping=1e-2,
        least_damping=1e-6,
    )
    say = None if report is None else lambda point, _: report(point.x, point.cost)
    found = minimise(posterior, posterior.point(x, r, J), bounds, control, say)
    return Solution(
        found.point.x,
        found.point.cost,
        float(found.point.misfit @ posterior.size / len(r)),
        found.n_iterations,
        found.stop is not Stop.OUT_OF_ITERATIONS,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """Unknowns, their cost, the robust mean square of each group, residuals; their Jacobian if at hand."""

    x: Floats
    cost: float
    misfit: Floats
    r: Complexes
    jacobian: Jacobian | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Derived(Linearisation):
    """The quadratic model with the derivatives of which it was made, for the n-th time."""

    posterior: "_Posterior"
    jacobian: Jacobian
    n_made: int

    def again(self, point: _Point) -> "_Derived | None":
        """Return the model at a point near by, with the residuals and weights there."""
        if self.n_made == self.jacobian.most_used:
            return None
        return self.posterior.with_derivatives(point, self.jacobian, self.n_made + 1)


@dataclass(frozen=True, slots=True, eq=False)
class _Posterior:
    """The negative log posterior that :func:`solve_robust` minimises."""

    residual: Residual
    derived: Linearised
    prior: Prior
    levels: Costs
    member: Ints  # group of each residual
    size: Ints  # of each group
    robust: float

    def point(self, x: Floats, r: Complexes, jacobian: Jacobian | None = None) -> _Point:
        """Return the cost of residuals."""
        misfit = np.bincount(self.member, pseudo_huber(r, self.robust), minlength=len(self.size)) / self.size
        return _Point(x, self.levels.cost(misfit) + self.prior.cost(x), misfit, r, jacobian)

    def at(self, x: Floats, near: _Point) -> _Point | None:
        try:
            return self.point(x, self.residual(x, False)[0])
        except np.linalg.LinAlgError:  # no structure: more mass taken away than there is
            return None

    def linearised(self, point: _Point) -> _Derived:
        return self.with_derivatives(point, point.jacobian or self.derived(point.x)[1], 1)

    def with_derivatives(self, point: _Point, jacobian: Jacobian, n_made: int) -> _Derived:
        """Return the quadratic model at a point with derivatives of there or near by."""
        weight = self.levels.weight(point.misfit) / self.size
        weight = weight[self.member] * pseudo_huber_weight(point.r, self.robust)
        (g,), (A,) = jacobian.products(point.r, weight)
        g = g + self.prior.slope(point.x)
        A += self.prior.information
        # What neither data nor priors hold would follow rounding.
        free = ~np.isfinite(self.prior.std) & (np.diag(A) < ROUNDING**2)
        g[free] = A[free] = A[:, free] = 0.0
        return _Derived(g, A, self, jacobian, n_made)
