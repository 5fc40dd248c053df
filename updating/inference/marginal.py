"""Evidence of a model by Laplace's approximation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fem.array_types import Complexes, Floats, Ints
from updating.least_squares.costs import Costs, Jacobian, pseudo_huber, pseudo_huber_weight

MOST_STEPS, MOST_HALVES = 12, 6
"""Steps to the most probable unknowns of a quadratic model, and halves of a step that goes too far."""
SETTLED = 1e-3
"""The steps end when the negative log posterior falls by less than this."""
ROUNDING = 1e-12
"""A model that is less probable than this adds nothing to a mixture."""


def log_evidence(
    log_likelihood: float, deviation: Floats, std: Floats, curvature: Floats, n_apart: int = 0
) -> float:
    """Return ln p(data) of a model by Laplace's approximation.

    ln p(data | ẑ) - ½ Σ ((ẑ - mean)/std)² - Σ ln std - ½ ln det A, with independent normal priors and A the
    second derivatives of the negative log posterior (MacKay, Information Theory, 2003, chapter 27).

    Errors of channels are told from one another by how channels differ, and the data for which a discrepancy
    of the model stands do not count that. The volume to which they shrink would count against whatever leaves
    a small discrepancy, so that it does not count: of the others' it is that beside them.

    Parameters
    ----------
    log_likelihood : float
        At the most probable unknowns ẑ.
    deviation : ndarray (n,)
        ẑ - mean.
    std : ndarray (n,)
    curvature : ndarray (n, n)
        A.
    n_apart : int
        Number of unknowns, the last ones, that are errors of channels.
    """
    n = len(std) - n_apart
    prior = -0.5 * float(((deviation / std) ** 2).sum()) - float(np.log(std[:n]).sum())
    volume = float(np.linalg.slogdet(curvature)[1]) - float(np.linalg.slogdet(curvature[n:, n:])[1])
    return log_likelihood + prior - 0.5 * volume


@dataclass(frozen=True, slots=True, eq=False)
class Quadratic:
    """Mean squares of groups of residuals near some unknowns, as quadratic functions of their changes.

    Residuals count there with the weights that the loss gives them at these unknowns.

    Attributes
    ----------
    levels : Costs
        Cost of the mean squares.
    v : ndarray (n_groups,)
        Mean squares at no change.
    slope : ndarray (n_groups, n)
        Half their slopes there.
    curvature : ndarray (n_groups, n, n)
        Half their second derivatives.
    n_apart : int
        As of :func:`log_evidence`.
    """

    levels: Costs
    v: Floats
    slope: Floats
    curvature: Floats
    n_apart: int = 0

    @classmethod
    def of(
        cls, r: Complexes, J: Jacobian, member: Ints, robust: float, levels: Costs, n_apart: int = 0
    ) -> "Quadratic":
        """Make it of residuals (m,), their Jacobian and the group of each."""
        size = np.bincount(member)
        slopes, curvatures = J.products(r, pseudo_huber_weight(r, robust) / size[member], member)
        return cls(levels, np.bincount(member, pseudo_huber(r, robust)) / size, slopes, curvatures, n_apart)

    def at(self, change: Floats) -> Floats:
        """Return the mean squares after a change of the unknowns."""
        return self.v + 2 * self.slope @ change + change @ (self.curvature @ change).T

    def normal(self, worth: Floats, std: Floats) -> Floats:
        """Return the second derivatives of the negative log posterior with what the groups are worth."""
        return np.tensordot(worth, self.curvature, 1) + np.diag(std**-2.0)

    def settled(self, deviation: Floats, std: Floats) -> "Settled":
        """Return the posterior with normal priors at the most probable values of the unknowns.

        Parameters
        ----------
        deviation : ndarray (n,)
            Of the unknowns from the priors' means at no change.
        std : ndarray (n,)
            Of the priors.
        """
        weight = std**-2.0

        def cost(d: Floats) -> float:
            return self.levels.cost(self.at(d)) + 0.5 * float(weight @ (deviation + d) ** 2)

        d = np.zeros(len(std))
        now = cost(d)
        for _ in range(MOST_STEPS):
            worth = self.levels.weight(self.at(d))
            slope = worth @ (self.slope + self.curvature @ d) + weight * (deviation + d)
            step = -np.linalg.solve(self.normal(worth, std), slope)
            length, then = _shortened(lambda part, d=d, step=step: cost(d + part * step), now)
            d = d + length * step
            if now - then < SETTLED:
                break
            now = then
        v = self.at(d)
        A = self.normal(self.levels.weight(v), std)
        return Settled(log_evidence(-self.levels.cost(v), deviation + d, std, A, self.n_apart), d, A)


class Settled(NamedTuple):
    """A posterior by its quadratic model: log evidence, change to its optimum, second derivatives."""

    log_evidence: float
    change: Floats
    curvature: Floats


def _shortened(cost: Callable[[float], float], now: float) -> tuple[float, float]:
    """Return how much of a step does not raise a cost, and the cost then."""
    part = 1.0
    for _ in range(MOST_HALVES):
        then = cost(part)
        if then <= now:
            return part, then
        part /= 2
    return 0.0, now


def by_size(near: Quadratic, deviation: Floats, std: Floats, rows: Ints, factors: Floats) -> list[Settled]:
    """Return the posteriors with some priors' standard deviations at multiples of theirs.

    Parameters
    ----------
    near : Quadratic
    deviation, std : ndarray (n,)
        As of :meth:`Quadratic.settled`.
    rows : ndarray of int
        Unknowns whose priors have one size in common.
    factors : ndarray (n_factors,)
    """
    out = []
    for factor in factors:
        scaled = std.copy()
        scaled[rows] *= factor
        out.append(near.settled(deviation, scaled))
    return out


def mixed(each: Sequence[Settled]) -> tuple[float, Floats, Floats]:
    """Return the log evidence of equally probable models, and mean change and covariance of their unknowns.

    Of the mixture of their normal approximations: Σ p d, and Σ p (A⁻¹ + (d - d̄) (d - d̄)ᵀ).
    """
    evidence = np.array([s.log_evidence for s in each])
    total = float(np.logaddexp.reduce(evidence))
    p = np.exp(evidence - total)
    mean = p @ np.array([s.change for s in each])
    covariance = np.zeros_like(each[0].curvature)
    for weight, s in zip(p, each, strict=True):
        if weight > ROUNDING:
            apart = s.change - mean
            covariance += weight * (np.linalg.inv(s.curvature) + np.outer(apart, apart))
    return total - float(np.log(len(each))), mean, covariance
