"""Laplace's evidence is exact where a model is linear."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fem import PointMass
from updating.inference import Quadratic, by_size, log_evidence, log_occam_factor
from updating.inference.fitting import _density
from updating.least_squares.costs import DenseJacobian


def test_evidence_of_a_linear_model_is_exact():
    """y = A z + e, e ~ N(0, 1), z ~ N(m, S²): ln p(y) is that of a Gaussian in closed form."""
    rng = np.random.default_rng(5)
    A, std, mean = rng.standard_normal((6, 2)), np.array([0.5, 2.0]), np.array([0.3, -1.0])
    y = rng.standard_normal(6)
    curvature = A.T @ A + np.diag(std**-2)
    z = np.linalg.solve(curvature, A.T @ y + mean / std**2)
    fit = -0.5 * ((y - A @ z) ** 2).sum() - 3 * np.log(2 * np.pi)
    C = np.eye(6) + (A * std**2) @ A.T
    r = y - A @ mean
    exact = -0.5 * r @ np.linalg.solve(C, r) - 0.5 * np.linalg.slogdet(C)[1] - 3 * np.log(2 * np.pi)
    assert log_evidence(fit, z - mean, std, curvature) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(("n_deviations", "error"), [(5.0, 0.06), (20.0, 0.004)])
def test_occam_factor_is_the_share_of_the_prior_that_the_data_leave(n_deviations, error):
    """A size of any order between two has the density 1 / (x ln(most / least)), and a normal likelihood."""
    mass = PointMass(name="m", member="arm", position=0.1, mass=0.2)
    problem = SimpleNamespace(surroundings=lambda key: 1.0)
    grid = [point["mass"] for point in mass.starts(problem.surroundings)]
    x = np.geomspace(min(grid), max(grid), 200_001)
    best = np.sqrt(min(grid) * max(grid))
    likelihood = np.exp(-0.5 * ((x - best) * n_deviations / best) ** 2)
    exact = np.trapezoid(likelihood / x, x) / np.log(max(grid) / min(grid))
    found = log_occam_factor(problem, mass, n_deviations, 1)
    assert found == pytest.approx(np.log(exact), abs=error)
    assert log_occam_factor(problem, mass, n_deviations, 7) == pytest.approx(found - np.log(7))


def test_evidence_of_a_size_is_that_of_a_fit_with_it():
    """With noise of known size the cost is N v / 2σ², and each size of a prior has a closed form."""
    rng, sigma = np.random.default_rng(6), 0.1
    A, std, off = rng.standard_normal((40, 3)), np.array([0.5, 2.0, 1.0]), np.array([0.2, -0.4, 0.1])
    r = sigma * rng.standard_normal(40)  # at unknowns that are off the priors' means by so much
    levels, group = Known(40, sigma**2), np.zeros(40, int)
    J = DenseJacobian(A.T.astype(complex))
    near = Quadratic.of(r.astype(complex), J, group, 100.0, levels)
    factors = [0.1, 1.0, 5.0]
    for factor, found in zip(factors, by_size(near, off, std, [1, 2], factors), strict=True):
        own = std * [1, factor, factor]
        C = sigma**2 * np.eye(40) + (A * own**2) @ A.T
        y = r - A @ off
        exact = -0.5 * y @ np.linalg.solve(C, y) - 0.5 * np.linalg.slogdet(C)[1] + 40 * np.log(sigma)
        assert found.log_evidence == pytest.approx(exact, abs=1e-4)
        mean = -(own**2) * (A.T @ np.linalg.solve(C, y))  # from the prior's mean
        np.testing.assert_allclose(off + found.change, mean, atol=1e-3)


@dataclass(frozen=True)
class Known:
    """The cost of n data with noise of known size, and their worth."""

    n: float
    square: float

    def cost(self, v):
        return 0.5 * self.n * float(v[0]) / self.square

    def weight(self, v):
        return np.array([self.n / self.square])


def test_where_there_is_no_structure_nothing_is_probable():
    """The mean over sizes of deviations may take more mass away than there is."""

    class Function:
        def prior_at(self, x):
            return np.zeros(2), np.ones(2)

        def misfit(self, x):
            np.linalg.cholesky(-np.eye(2))

    function, levels = cast("Any", Function()), cast("Any", None)
    density = _density(function, levels, np.zeros(2), np.array([1]), np.array([0.5, 1.0]))
    assert density == -np.inf
